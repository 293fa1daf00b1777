// SPDX-License-Identifier: Apache-2.0
// Around imihajlow/etester: its UART, FIFO and Modbus bridge, wired as one slave with eight registers. It has no DE.
`default_nettype none

module etester_slave (
    input wire clk,
    input wire rst,
    input wire rx,
    output wire tx
);
  localparam [23:0] DIVISOR = 24'd79;  // clk is 160 times the rate
  localparam [23:0] FIRST = 24'hA00000;

  wire [8:0] received;
  wire receiver_clk, fifo_clk, received_valid, parity_error, overflow, silence, receive_req;
  wire full, put, put_ack, take, take_ack;
  wire [7:0] reply_byte, sent_byte;
  wire [23:0] address;
  wire [15:0] written;
  reg [15:0] read;
  wire cycle, strobe, write;
  reg [15:0] registers[0:7];
  integer n;
  initial for (n = 0; n < 8; n = n + 1) registers[n] = 0;

  always @(negedge clk)
    if (cycle && strobe) begin
      if (write) registers[address[2:0]] <= written;
      else read <= registers[address[2:0]];
    end

  UartReceiver receiver_i (
      .clk(receiver_clk),
      .rst(rst),
      .rx(rx),
      .dataBits(2'b11),
      .hasParity(1'b1),
      .parityMode(2'b10),
      .extraStopBit(1'b0),
      .clockDivisor(DIVISOR),
      .dataOut(received),
      .dataReceived(received_valid),
      .parityError(parity_error),
      .overflow(overflow),
      .\break (),
      .silence(silence),
      .receiveReq(receive_req)
  );

  ModbusToWishbone #(
      .MODBUS_STATION_ADDRESS(8'd17),
      .OFFSET_HOLDING_REGISTERS(FIRST),
      .QUANTITY_HOLDING_REGISTERS(8)
  ) bridge_i (
      .clk(clk),
      .rst(rst),
      .wbAdrO(address),
      .wbDatO(written),
      .wbDatI(read),
      .wbCycO(cycle),
      .wbStbO(strobe),
      .wbAckI(cycle && strobe),
      .wbWeO(write),
      .uartClk(receiver_clk),
      .uartDataIn(received),
      .uartDataReceived(received_valid),
      .parityError(parity_error),
      .overflow(overflow),
      .silence(silence),
      .uartReceiveReq(receive_req),
      .fifoClk(fifo_clk),
      .full(full),
      .fifoWriteReq(put),
      .fifoWriteAck(put_ack),
      .fifoDataOut(reply_byte)
  );

  Fifo #(
      .DATA_WIDTH(8)
  ) fifo_i (
      .clk(fifo_clk),
      .rst(rst),
      .empty(),
      .full(full),
      .readReq(take),
      .readAck(take_ack),
      .writeReq(put),
      .writeAck(put_ack),
      .dataIn(reply_byte),
      .dataOut(sent_byte)
  );

  UartTransmitter transmitter_i (
      .clk(~fifo_clk),
      .rst(rst),
      .tx(tx),
      .dataBits(2'b11),
      .hasParity(1'b1),
      .parityMode(2'b10),
      .extraStopBit(1'b0),
      .clockDivisor(DIVISOR),
      .ready(take),
      .data(sent_byte),
      .transmitReq(take_ack)
  );
endmodule

`default_nettype wire
