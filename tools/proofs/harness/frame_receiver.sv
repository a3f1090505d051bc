// SPDX-License-Identifier: Apache-2.0
// The receiver of Ethernet frames: whatever the line brings, only a frame with a right FCS, without an error of the PHY
// and of a legal length leaves as a good one; every other one that has begun to leave is aborted, and each good frame on
// the line leaves once.
//
// Assumed: the first cycle is a reset, and no other is. The line is free: any bytes, any pauses, any cuts.
module frame_receiver (input clk);

localparam SHORTEST = 64;
localparam COUNT_BITS = $clog2(`LONGEST + 5);

(* anyseq *) wire       rx_step;
(* anyseq *) wire       rx_dv;
(* anyseq *) wire       rx_er;
(* anyseq *) wire [7:0] rxd;
wire [7:0]              m_axis_tdata;
wire                    m_axis_tuser;
wire                    m_axis_tvalid;
wire                    m_axis_tlast;
wire                    is_good;
wire                    is_broken;
wire                    is_long;

reg is_first_cycle = 1;
always @(posedge clk) is_first_cycle <= 0;
wire rst_n = !is_first_cycle;
reg was_reset = 0;
always @(posedge clk) was_reset <= !rst_n;
wire running = rst_n;

firm_mac_receiver dut (
    .clk(clk),
    .rst_n(rst_n),
    .rx_step(rx_step),
    .rx_dv(rx_dv),
    .rx_er(rx_er),
    .rxd(rxd),
    .m_axis_tdata(m_axis_tdata),
    .m_axis_tuser(m_axis_tuser),
    .m_axis_tvalid(m_axis_tvalid),
    .m_axis_tlast(m_axis_tlast),
    .is_good(is_good),
    .is_broken(is_broken),
    .is_long(is_long));

// What the line means, by IEEE 802.3: a burst of rx_dv is preamble, start and frame. The checksum is that of clause
// 3.2.9, bit by bit in the order of the line: a shift register with the polynomial, which begins with ones.
function [31:0] shifted (input [31:0] register, input [7:0] octet);
    integer index;
    begin
        shifted = register;
        for (index = 0; index < 8; index = index + 1)
            shifted = {shifted[30:0], 1'b0} ^ (shifted[31] ^ octet[index] ? 32'h04c11db7 : 32'h0);
    end
endfunction
localparam [31:0] REMAINDER = 32'hc704dd7b;  // after a frame with its FCS

localparam GAP = 0, PREAMBLE = 1, INSIDE = 2, IGNORED = 3;
reg [1:0]            at;
reg [31:0]           register;
reg [COUNT_BITS-1:0] bytes;
reg                  had_error;
wire                 takes    = at == INSIDE && rx_step && rx_dv;
wire                 ends     = at == INSIDE && rx_step && !rx_dv;
wire                 too_long = takes && bytes == `LONGEST + 4;
wire                 right    = register == REMAINDER && bytes >= SHORTEST && !had_error;
always @(posedge clk) begin
    if (!rst_n) begin
        at    <= IGNORED;
        bytes <= 0;
    end else if (rx_step) begin
        if (!rx_dv) at <= GAP;
        else if (at == GAP || at == PREAMBLE) begin
            at        <= rx_er ? IGNORED : rxd == 8'h55 ? PREAMBLE : rxd == 8'hd5 ? INSIDE : IGNORED;
            register  <= 32'hffffffff;
            bytes     <= 0;
            had_error <= 0;
        end else if (at == INSIDE) begin
            register  <= shifted(register, rxd);
            bytes     <= bytes + 1;
            had_error <= had_error || rx_er;
            if (too_long) at <= IGNORED;
        end
    end
end

// The verdict on the frame, as it should be shown in the cycle after its end.
reg ended, was_right, was_long, was_ended_bad, had_byte;
always @(posedge clk) begin
    ended         <= rst_n && (ends || too_long);
    was_right     <= rst_n && ends && right;
    was_long      <= rst_n && too_long;
    was_ended_bad <= rst_n && ends && !right;
    had_byte      <= rst_n && (takes || ends) && bytes > 4;
end

// The bytes of the frame that leave: each is the one of the line that came five bytes before.
reg [39:0] recent;
reg [7:0]  oldest;
always @(posedge clk) begin
    if (takes) recent <= {rxd, recent[39:8]};
    oldest <= recent[7:0];
end

// Bytes of a frame have left without its last one.
reg inside;
always @(posedge clk) inside <= rst_n && (m_axis_tvalid ? !m_axis_tlast : inside);

// What ties the registers to the line.
(* hierconn *) wire [1:0]  \dut.state_r ;
(* hierconn *) wire [31:0] \dut.u_crc.crc_r ;
(* hierconn *) wire        \dut.error_r ;
(* hierconn *) wire [39:0] \dut.delay_r ;
(* hierconn *) wire [COUNT_BITS-1:0] \dut.count_r ;
wire [31:0] mirrored;
wire [39:0] known = ~(40'hffffffffff >> (8 * (bytes > 5 ? 5 : bytes)));
genvar place;
generate
    for (place = 0; place < 32; place = place + 1) assign mirrored[place] = \dut.u_crc.crc_r [31-place];
endgenerate

always @* if (running) begin
    good_if_right: assert ((m_axis_tvalid && m_axis_tlast && !m_axis_tuser) == was_right);
    begun_frames_end: assert (!(ended && inside) || (m_axis_tvalid && m_axis_tlast));
    one_end: assert (!(m_axis_tvalid && m_axis_tlast) || ended);
    bytes_unchanged: assert (m_axis_tvalid == had_byte && (!m_axis_tvalid || m_axis_tdata == oldest));
    one_verdict: assert (is_good == was_right && is_long == was_long && (!was_ended_bad || is_broken));
    no_second_verdict: assert (32'd0 + is_good + is_broken + is_long <= 1);

    helper_state: assert (\dut.state_r == at);
    if (at == INSIDE) begin
        helper_register: assert (mirrored == register);
        helper_error: assert (\dut.error_r == had_error);
        helper_delay: assert (((\dut.delay_r ^ recent) & known) == 0);
        helper_inside: assert (!ended && (inside || m_axis_tvalid) == (bytes > 5));
        helper_bytes: assert (\dut.count_r == bytes && bytes <= `LONGEST + 4);
    end else helper_outside: assert (ended || !(inside || m_axis_tvalid));
end

endmodule
