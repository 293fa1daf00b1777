-- SPDX-License-Identifier: Apache-2.0
-- Wireshark dissector of Danfoss' FC protocol (FC-1 to FC-8), and of the card's network line.
--
-- vltfc          the drive line, link type USER1: every field of a telegram, control and status word bit by
--                bit, BCC checked, request and reply linked. Parameter names: by preference, or by the drive
--                in the capture's interface description.
-- rtu2fc_modbus  the network line, link type USER0: Wireshark's own Modbus RTU dissector, with the direction from
--                the capture (a reply to 05 and 06 looks like its request), and with names of the drive's
--                parameters and process words.
--
-- Load it with -X lua_script:fc.lua, or put it, regs/generated/fc_tables.lua and sim/drive/*.csv into the folder of
-- personal Lua plugins.
-- Needs Wireshark 4.0 or newer, and in its preferences mbrtu.tcp.port = MODBUS_PORT below (wireshark_profile/preferences).

local folder = debug.getinfo(1, "S").source:match("^@(.*[/\\])") or ""
local unpack_table = table.unpack or unpack
-- The tables lie beside this file in a plugin folder, in regs/generated and sim/drive in the project.
local file = io.open(folder .. "fc_tables.lua")
local beside = file ~= nil
if file then file:close() end
local tables = dofile(folder .. (beside and "" or "../../regs/generated/") .. "fc_tables.lua")

-- The cells of a row of a CSV file; quotes stand around a cell with commas.
local function cells(row)
  local found, at = {}, 1
  while at <= #row + 1 do
    local quoted = row:match('^"([^"]*)"', at)
    local cell = quoted or row:match("^[^,]*", at)
    found[#found + 1], at = cell, at + #cell + (quoted and 3 or 1)
  end
  return found
end

-- A drive: the mask of its parameter numbers, which bits with `only` it has, its parameters by number.
local function drive_table(name)
  local drive = { pnu_mask = 0x7FF, kinds = { vlt_status = true, one_ramp = true }, parameters = {} }
  for row in io.lines(folder .. (beside and "" or "../drive/") .. name .. ".csv") do
    local key, setting = row:match("^#: (%S+) = (%S+)")
    local pnu, label, kind, conversion, _, _, _, _, _, _, unit, role = unpack_table(cells(row))
    if key == "pnu_bits" then
      drive.pnu_mask = setting == "12" and 0xFFF or 0x7FF
    elseif key == "fc_status" and setting == "1" then
      drive.kinds.fc_status, drive.kinds.vlt_status = true, nil
    elseif tonumber(pnu) then
      drive.parameters[tonumber(pnu)] = { label, kind, tonumber(conversion), unit }
      if role == "ramp_up_2" then drive.kinds.two_ramps, drive.kinds.one_ramp = true, nil end
    end
  end
  return drive
end

tables.drives = {}
for _, name in ipairs(tables.drive_names) do
  tables.drives[name] = drive_table(name)
end
local bits = bit or bit32 -- Wireshark's Lua is 5.2 or 5.4

local STX = 0x02
local CHARACTER_BITS, BAUD = 11, 9600
local FULL_SCALE = 0x4000 -- 100 %
local AROUND_DATA = 4 -- STX, LGE, ADR, BCC
local PROCESS, PARAMETER, AROUND_TEXT = 4, 12, 8 -- bytes of data; of a text telegram without the text
local BIT_15, DATA_VALID = 15, 10 -- bit fields count from the highest bit
local AK_REFUSED, AK_TEXT, IND_TEXT_READ, IND_TEXT_WRITE = 7, 15, 0x04, 0x05
local TEXT_WORDS = { [IND_TEXT_READ] = " (read text)", [IND_TEXT_WRITE] = " (write text)" }
local MODBUS_PORT, MASTER_PORT = 8502, 8503 -- distinguish card and master for the Modbus dissector

-- ---------------------------------------------------------------- words
local function parameter_name(drive, pnu)
  local known = drive.parameters[pnu]
  return known and known[1] or "unknown"
end

-- Formats a transferred value with decimals and unit; signed by the parameter's type.
local function scaled(drive, pnu, raw)
  local known = drive.parameters[pnu]
  if not known then
    return tostring(raw)
  end
  local _, kind, conversion, unit = unpack_table(known)
  if kind == "int32" and raw >= 0x80000000 then
    raw = raw - 0x100000000
  elseif kind == "int16" then
    raw = raw % 0x10000
    raw = raw >= 0x8000 and raw - 0x10000 or raw
  end
  local text = tostring(raw)
  if conversion < 0 and conversion > -6 then
    text = string.format("%." .. -conversion .. "f", raw * 10.0 ^ conversion)
  elseif conversion > 0 and conversion < 6 then
    text = string.format("%d", raw * 10 ^ conversion)
  end
  return unit ~= "" and text .. " " .. unit or text
end

local function percent(word)
  local signed = word >= 0x8000 and word - 0x10000 or word
  return 100.0 * signed / FULL_SCALE
end

-- Texts are Latin-1; unprintable characters become dots.
local function latin1(range)
  local text = {}
  for at = 0, range:len() - 1 do
    local code = range(at, 1):uint()
    if code >= 0x20 and code < 0x7F then
      text[#text + 1] = string.char(code)
    elseif code >= 0xA0 then
      text[#text + 1] = string.char(0xC0 + math.floor(code / 64), 0x80 + code % 64)
    else
      text[#text + 1] = "."
    end
  end
  return table.concat(text)
end

-- Converts seconds for a relative_time field, to the nanosecond.
local function seconds(value)
  return NSTime.new(math.floor(value), math.floor(value % 1 * 1e9 + 0.5))
end

-- ---------------------------------------------------------------- fields
local fc = Proto("vltfc", "Danfoss FC protocol")
local f = {
  stx = ProtoField.uint8("vltfc.stx", "STX", base.HEX),
  lge = ProtoField.uint8("vltfc.lge", "LGE", base.DEC),
  adr = ProtoField.uint8("vltfc.adr", "ADR", base.HEX),
  address = ProtoField.uint8("vltfc.address", "Drive", base.DEC),
  broadcast = ProtoField.bool("vltfc.broadcast", "Broadcast"),
  reply = ProtoField.bool("vltfc.reply", "From the drive"),
  pke = ProtoField.uint16("vltfc.pke", "PKE", base.HEX),
  ak = ProtoField.uint8("vltfc.ak", "AK", base.DEC),
  ak_words = ProtoField.string("vltfc.ak.words", "AK in words"),
  pnu = ProtoField.uint16("vltfc.pnu", "PNU", base.DEC),
  name = ProtoField.string("vltfc.pnu.name", "Parameter"),
  ind = ProtoField.uint16("vltfc.ind", "IND", base.HEX),
  index = ProtoField.uint8("vltfc.index", "Index", base.DEC),
  pwe = ProtoField.uint32("vltfc.pwe", "PWE", base.DEC_HEX),
  pwe_signed = ProtoField.int32("vltfc.pwe.signed", "PWE, signed", base.DEC),
  value = ProtoField.string("vltfc.value", "Value"),
  text = ProtoField.string("vltfc.text", "Text"),
  fault = ProtoField.uint16("vltfc.fault", "Fault number", base.DEC),
  fault_words = ProtoField.string("vltfc.fault.words", "Fault"),
  control = ProtoField.uint16("vltfc.ctw", "Control word", base.HEX),
  reference = ProtoField.int16("vltfc.ref", "Reference", base.DEC),
  reference_percent = ProtoField.double("vltfc.ref.percent", "Reference, %"),
  status = ProtoField.uint16("vltfc.stw", "Status word", base.HEX),
  frequency = ProtoField.int16("vltfc.freq", "Output frequency", base.DEC),
  frequency_percent = ProtoField.double("vltfc.freq.percent", "Output frequency, %"),
  bcc = ProtoField.uint8("vltfc.bcc", "BCC", base.HEX),
  bcc_good = ProtoField.bool("vltfc.bcc.good", "BCC good"),
  request_frame = ProtoField.framenum("vltfc.request_frame", "Request in frame", base.NONE, frametype.REQUEST),
  reply_frame = ProtoField.framenum("vltfc.reply_frame", "Reply in frame", base.NONE, frametype.RESPONSE),
  repeat_of = ProtoField.framenum("vltfc.repeat_of", "Repeats frame", base.NONE, frametype.DUP_ACK),
  time = ProtoField.relative_time("vltfc.time", "Time from the request"),
  pause = ProtoField.relative_time("vltfc.pause", "From the request's last stop bit to the first start bit"),
}
local control_bits, status_bits = {}, {}
for prefix, kind in pairs({ ctw = "control", stw = "status" }) do
  local fields = kind == "control" and control_bits or status_bits
  for _, entry in ipairs(tables[kind]) do
    local field = ProtoField.bool(
      "vltfc." .. prefix .. "." .. entry.id,
      string.format("Bit %d, %s", entry.bit, entry.name),
      16,
      { entry.one, entry.zero },
      2 ^ entry.bit
    )
    fields[#fields + 1] = { field = field, only = entry.only, bit = entry.bit }
    f[prefix .. entry.id] = field
  end
end
fc.fields = f

local e = {
  stx = ProtoExpert.new("vltfc.bad_stx", "No STX", expert.group.MALFORMED, expert.severity.ERROR),
  lge = ProtoExpert.new("vltfc.bad_lge", "LGE does not fit", expert.group.MALFORMED, expert.severity.ERROR),
  bcc = ProtoExpert.new("vltfc.bad_bcc", "BCC wrong", expert.group.CHECKSUM, expert.severity.ERROR),
  refused = ProtoExpert.new("vltfc.refused", "Refused", expert.group.RESPONSE_CODE, expert.severity.WARN),
  silent = ProtoExpert.new("vltfc.no_reply", "No reply", expert.group.SEQUENCE, expert.severity.WARN),
  other = ProtoExpert.new("vltfc.other", "Reply to another request", expert.group.SEQUENCE, expert.severity.WARN),
}
fc.experts = e

local BY_CAPTURE = 0
local choices = { { 1, "as the capture says", BY_CAPTURE } }
for number, name in ipairs(tables.drive_names) do
  choices[#choices + 1] = { number + 1, name, number }
end
fc.prefs.drive = Pref.enum("Drive", BY_CAPTURE, "Whose parameter names and status bits", choices, false)

-- Description of the interface on which a packet was captured.
local interface_description = Field.new("frame.interface_description")

local function drive_of()
  if fc.prefs.drive ~= BY_CAPTURE then
    return tables.drives[tables.drive_names[fc.prefs.drive]]
  end
  local said = interface_description()
  return tables.drives[said and said.value:match("([%w_]+)$")] or tables.drives.vlt6000
end

-- ---------------------------------------------------------------- process words
local function add_process(tree, range, reply, drive)
  local first, second = range(0, 2), range(2, 2)
  local word = reply and f.status or f.control
  local branch = tree:add(word, first)
  if not reply and first:bitfield(BIT_15 - DATA_VALID, 1) == 0 then
    branch:append_text(" (ignored: data not valid)")
  end
  for _, entry in ipairs(reply and status_bits or control_bits) do
    if not entry.only or drive.kinds[entry.only] then
      branch:add(entry.field, first)
    end
  end
  local share = percent(second:uint())
  tree:add(reply and f.frequency or f.reference, second):append_text(string.format(" (%.2f %%)", share))
  tree:add(reply and f.frequency_percent or f.reference_percent, second, share)
  local names = reply and "status %04Xh, frequency %.1f %%" or "control %04Xh, reference %.1f %%"
  return string.format(names, first:uint(), share)
end

-- ---------------------------------------------------------------- the parameter or text part
local function add_parameter(tree, data, reply, drive)
  local pke, ind = data(0, 2), data(2, 2)
  local ak, pnu = pke:bitfield(0, 4), bits.band(pke:uint(), drive.pnu_mask)
  local words = (reply and tables.reply or tables.request)[ak] or "unknown"
  local name = parameter_name(drive, pnu)
  local branch = tree:add(f.pke, pke)
  branch:add(f.ak, data(0, 1), ak):append_text(" (" .. words .. ")")
  branch:add(f.ak_words, data(0, 1), words):set_generated()
  branch:add(f.pnu, pke, pnu)
  branch:add(f.name, pke, name):set_generated()
  local index = data(3, 1):uint()
  local ind_item = tree:add(f.ind, ind)
  ind_item:add(f.index, data(3, 1), index)
  if ak == AK_TEXT then
    ind_item:append_text(TEXT_WORDS[data(2, 1):uint()] or " (neither read nor write of a text)")
  end

  local is_text = ak == AK_TEXT and (reply or data(2, 1):uint() ~= IND_TEXT_READ)
  local value = data(4, data:len() - AROUND_TEXT)
  local what = string.format("%s %d %s", words, pnu, name) .. (index > 0 and " [" .. index .. "]" or "")
  if is_text then
    local text = latin1(value)
    tree:add(f.text, value, text)
    return string.format("%s = '%s'", what, text)
  end
  if value:len() ~= 4 then
    return what
  end
  local branch_value = tree:add(f.pwe, value)
  branch_value:add(f.pwe_signed, value)
  if reply and ak == AK_REFUSED then
    local fault = data(6, 2):uint()
    local why = tables.fault[fault] or "other fault of the drive"
    branch_value:add(f.fault, data(6, 2)):append_text(" (" .. why .. ")")
    branch_value:add(f.fault_words, data(6, 2), why):set_generated()
    branch_value:add_proto_expert_info(e.refused, "Refused: " .. why)
    return what .. ": " .. why
  end
  if ak == 0 or ak == AK_TEXT or (ak == 1 and not reply) then
    return what
  end
  local shown = scaled(drive, pnu, value:uint())
  branch_value:add(f.value, value, shown):set_generated()
  return what .. " = " .. shown
end

-- ---------------------------------------------------------------- requests and replies
local pending -- the request without a reply so far, during the first pass over the file
local linked = {} -- frame number -> data of the linked frame

function fc.init()
  pending, linked = nil, {}
end

local function is_broadcast(adr)
  return adr == 0x80 or bits.band(adr, 0xA0) == 0x20
end

-- Uses the capture's direction. Without one, a frame after a request from the same address is its reply.
local function is_reply(pinfo, adr)
  if pinfo.p2p_dir == P2P_DIR_SENT then
    return false
  elseif pinfo.p2p_dir == P2P_DIR_RECV then
    return true
  elseif linked[pinfo.number] then
    return linked[pinfo.number].reply
  end
  return pending ~= nil and pending.adr == adr
end

local function follow(pinfo, seen)
  local entry = { reply = seen.reply }
  linked[pinfo.number] = entry
  if seen.reply and pending then
    local asked = linked[pending.number]
    if pending.pnu == seen.pnu then
      asked.partner, entry.partner = pinfo.number, pending.number
      entry.time = pinfo.abs_ts - pending.at
      entry.pause = entry.time - pending.bytes * CHARACTER_BITS / BAUD
      pending = nil
    else
      entry.other = true
    end
  elseif not seen.reply then
    if pending then
      linked[pending.number].silent = pinfo.number
      entry.after_silence = pending.number
      entry.repeat_of = pending.telegram == seen.telegram and pending.number or nil
    end
    pending = not is_broadcast(seen.adr) and seen or nil
  end
end

local function add_links(tree, pinfo)
  local entry = linked[pinfo.number]
  if not entry then
    return
  end
  local function add(field, value)
    if value then
      tree:add(field, value):set_generated()
    end
  end
  add(entry.reply and f.request_frame or f.reply_frame, entry.partner)
  add(f.repeat_of, entry.repeat_of)
  add(f.time, entry.time and seconds(entry.time))
  if entry.pause and entry.pause >= 0 then
    add(f.pause, seconds(entry.pause))
  end
  if entry.silent then
    tree:add_proto_expert_info(e.silent, "No reply before the next request")
  end
  if pinfo.visited and pending and pending.number == pinfo.number then
    tree:add_proto_expert_info(e.silent, "No reply up to the end of the recording")
  end
  if entry.after_silence then
    local before = string.format("No reply to the request in frame %d", entry.after_silence)
    tree:add_proto_expert_info(e.silent, before)
  end
  if entry.other then
    tree:add_proto_expert_info(e.other)
  end
end

-- ---------------------------------------------------------------- a telegram
local function bcc_of(tvb)
  local sum = 0
  for at = 0, tvb:len() - 2 do
    sum = bits.bxor(sum, tvb(at, 1):uint())
  end
  return sum
end

function fc.dissector(tvb, pinfo, root)
  pinfo.cols.protocol = "FC"
  local tree = root:add(fc, tvb())
  local length = tvb:len()
  local first = tree:add(f.stx, tvb(0, 1))
  if tvb(0, 1):uint() ~= STX then
    first:add_proto_expert_info(e.stx)
    pinfo.cols.info = "no STX"
    return length
  end
  local lge = length > 1 and tvb(1, 1):uint() or 0
  local lge_item = length > 1 and tree:add(f.lge, tvb(1, 1)) or tree
  local data_length = length - AROUND_DATA
  if lge + 2 ~= length or data_length < PROCESS then
    lge_item:add_proto_expert_info(e.lge, string.format("LGE %d, but %d bytes", lge, length))
    pinfo.cols.info = string.format("LGE %d does not fit %d bytes", lge, length)
    return length
  end

  local drive = drive_of()
  local adr = tvb(2, 1):uint()
  local reply = is_reply(pinfo, adr)
  local adr_item = tree:add(f.adr, tvb(2, 1))
  adr_item:add(f.address, tvb(2, 1), bits.band(adr, adr >= 0x80 and 0x7F or 0x1F))
  adr_item:add(f.broadcast, tvb(2, 1), is_broadcast(adr))
  tree:add(f.reply, reply):set_generated()

  local data = tvb(3, data_length)
  local words, pnu = ""
  if data_length >= AROUND_TEXT then
    pnu = bits.band(data(0, 2):uint(), drive.pnu_mask)
    words = add_parameter(tree, data, reply, drive) .. "; "
  end
  words = words .. add_process(tree, data(data_length - PROCESS, PROCESS), reply, drive)

  local bcc, right = tvb(length - 1, 1), bcc_of(tvb)
  local good = bcc:uint() == right
  local bcc_item = tree:add(f.bcc, bcc)
  bcc_item:add(f.bcc_good, bcc, good):set_generated()
  if not good then
    bcc_item:add_proto_expert_info(e.bcc, string.format("BCC %02Xh, %02Xh would be right", bcc:uint(), right))
  elseif not pinfo.visited then
    follow(pinfo, {
      number = pinfo.number,
      at = pinfo.abs_ts,
      adr = adr,
      pnu = pnu,
      reply = reply,
      bytes = length,
      telegram = tostring(tvb:bytes()),
    })
  end
  add_links(tree, pinfo)
  local who = reply and "Reply: " or is_broadcast(adr) and "To all: " or "Request: "
  pinfo.cols.info = (good and "" or "BCC wrong, ") .. who .. words
  tree:append_text(", " .. who .. words)
  return length
end

-- ---------------------------------------------------------------- the network line
local network = Proto("rtu2fc_modbus", "Modbus RTU of a VLT")
local modbus = Dissector.get("mbrtu")
local n = {
  parameter = ProtoField.uint16("rtu2fc_modbus.pnu", "Parameter", base.DEC),
  name = ProtoField.string("rtu2fc_modbus.name", "Name"),
  control = ProtoField.uint16("rtu2fc_modbus.ctw", "Control word", base.HEX),
  reference = ProtoField.double("rtu2fc_modbus.ref", "Reference, %"),
  code = ProtoField.uint8("rtu2fc_modbus.func_code", "Function code", base.DEC),
  first = ProtoField.uint16("rtu2fc_modbus.reference_num", "Reference number", base.DEC),
  crc = ProtoField.uint16("rtu2fc_modbus.crc", "CRC", base.HEX),
  crc_good = ProtoField.bool("rtu2fc_modbus.crc.good", "CRC good"),
  pause = ProtoField.relative_time("rtu2fc_modbus.pause", "From the request's last stop bit to the first start bit"),
}
network.fields = n
local bad_crc = ProtoExpert.new("rtu2fc_modbus.bad_crc", "Incorrect CRC", expert.group.CHECKSUM, expert.severity.ERROR)
network.experts = { bad_crc }
local READ_REGISTERS, WRITE_COIL, WRITE_REGISTER, WRITE_COILS, WRITE_REGISTERS = 0x03, 0x05, 0x06, 0x0F, 0x10
local WORD_COILS = 16 -- the control word; the reference has the 16 after it
local SHORTEST, SHORTEST_KNOWN = 4, 5 -- bytes; Wireshark's dissector leaves the shortest alone

-- Adds control word and reference as far as a request writes their coils: first coil, count, values.
local function add_coils(tvb, root, first, count, value)
  local last = math.min(first + count, 2 * WORD_COILS) - 1
  if last < first or value:len() * 8 < last - first + 1 then
    return
  end
  local function bit_of(coil)
    local at = coil - first
    return bits.band(value(math.floor(at / 8), 1):uint(), 2 ^ (at % 8)) ~= 0
  end
  local tree = root:add(network, value)
  local branch = tree
  if first == 0 and last >= WORD_COILS - 1 then
    branch = tree:add_le(n.control, value(0, 2))
  elseif first < WORD_COILS then
    tree:append_text(string.format(first == last and ", coil %d" or ", coils %d-%d", first + 1, last + 1))
  end
  if first < WORD_COILS then
    for _, entry in ipairs(control_bits) do
      local known = not entry.only or drive_of().kinds[entry.only]
      if known and entry.bit >= first and entry.bit <= last then
        branch:add(entry.field, value, bit_of(entry.bit) and 2 ^ entry.bit or 0)
      end
    end
  end
  if first <= WORD_COILS and last == 2 * WORD_COILS - 1 then
    local reference = 0
    for coil = WORD_COILS, last do
      reference = reference + (bit_of(coil) and 2 ^ (coil - WORD_COILS) or 0)
    end
    tree:add(n.reference, value, percent(reference))
  end
end

-- Adds the meaning of a request for a VLT: its parameter, or control word and reference.
local function add_meaning(tvb, root)
  local code, address = tvb(1, 1):uint(), tvb(2, 2):uint()
  local is_register = code == READ_REGISTERS or code == WRITE_REGISTER or code == WRITE_REGISTERS
  if is_register and (address + 1) % 10 == 0 then
    local tree = root:add(network, tvb(2, 2))
    local pnu = (address + 1) / 10
    tree:add(n.parameter, tvb(2, 2), pnu)
    tree:add(n.name, tvb(2, 2), parameter_name(drive_of(), pnu)):set_generated()
  elseif code == WRITE_COIL then
    add_coils(tvb, root, address, 1, tvb(4, 1))
  elseif code == WRITE_COILS and tvb:len() > 9 then
    add_coils(tvb, root, address, tvb(4, 2):uint(), tvb(7, tvb:len() - 9))
  end
end

-- ---------------------------------------------------------------- requests and replies of the network line
local asked -- the last request, during the first pass over the file
local answers = {} -- frame number of a reply -> seconds since its request began, length of that request

function network.init()
  asked, answers = nil, {}
end

-- Duration of so many bytes in seconds, at the rate in the capture's interface description.
local function seconds_of(bytes)
  local said = interface_description()
  local baud, parity, stop_bits = (said and said.value or ""):match("(%d+) 8([NEO])([12])$")
  if baud then
    return bytes * (9 + (parity == "N" and 0 or 1) + tonumber(stop_bits)) / tonumber(baud)
  end
end

local function follow_network(tvb, pinfo, request)
  if request then
    asked = { at = pinfo.abs_ts, bytes = tvb:len() }
  elseif asked then
    answers[pinfo.number] = { after = pinfo.abs_ts - asked.at, bytes = asked.bytes }
    asked = nil
  end
end

local function crc_of(tvb)
  local crc = 0xFFFF
  for at = 0, tvb:len() - 3 do
    crc = bits.bxor(crc, tvb(at, 1):uint())
    for _ = 1, 8 do
      local odd = crc % 2 == 1
      crc = (crc - crc % 2) / 2
      crc = odd and bits.bxor(crc, 0xA001) or crc
    end
  end
  return crc
end

-- Wireshark's dissector rejects unit 0, which is a request to all, and skips a frame that is only a function
-- code.
local function by_ourselves(tvb, pinfo, root, who)
  local tree = root:add(network, tvb(), "Modbus RTU, " .. who)
  tree:add(n.code, tvb(1, 1))
  if tvb:len() >= 8 then
    tree:add(n.first, tvb(2, 2))
  end
  local crc = tvb(tvb:len() - 2, 2)
  local item = tree:add_le(n.crc, crc)
  local good = crc:le_uint() == crc_of(tvb)
  item:add(n.crc_good, crc, good):set_generated()
  if not good then
    item:add_proto_expert_info(bad_crc)
  end
  pinfo.cols.protocol = "Modbus RTU"
  pinfo.cols.info = string.format("%s: Func: %3d", who, tvb(1, 1):uint())
end

function network.dissector(tvb, pinfo, root)
  local request = pinfo.p2p_dir == P2P_DIR_RECV
  if request then
    pinfo.src_port, pinfo.dst_port = MASTER_PORT, MODBUS_PORT
  elseif pinfo.p2p_dir == P2P_DIR_SENT then
    pinfo.src_port, pinfo.dst_port = MODBUS_PORT, MASTER_PORT
  end
  -- Comes first: an error in the built-in dissector ends this function too.
  if not pinfo.visited then
    follow_network(tvb, pinfo, request)
  end
  local answer = answers[pinfo.number]
  local long = answer and seconds_of(answer.bytes)
  if long and answer.after >= long then
    root:add(network, tvb(), "Reply"):add(n.pause, seconds(answer.after - long)):set_generated()
  end
  local length = tvb:len()
  if length >= SHORTEST and tvb(0, 1):uint() == 0 then
    by_ourselves(tvb, pinfo, root, "To all")
  elseif length >= SHORTEST and length < SHORTEST_KNOWN then
    by_ourselves(tvb, pinfo, root, string.format("Unit %d", tvb(0, 1):uint()))
  else
    modbus:call(tvb, pinfo, root)
  end
  if request and length >= 8 then
    add_meaning(tvb, root)
  end
  return length
end
