// SPDX-License-Identifier: Apache-2.0
// A generated subscriber of ROS 1's std_msgs/String at 8 bits with a longest payload: of a frame whose header announces
// more, nothing leaves, and it is reported with code 7.
//
// Assumed: the first cycle is a reset, and no other is; the source keeps a beat until it is taken, and marks aborts on a
// last beat only. The highest bit of a text's bytes tells whether its frame is too long: the subscriber decides by the
// header alone, so that what holds for these texts holds for all.
module refused_frames (input clk);

localparam TOO_LONG = 7;

(* anyseq *) wire [7:0] s_axis_tdata;
(* anyseq *) wire       s_axis_tuser;
(* anyseq *) wire       s_axis_tvalid;
(* anyseq *) wire       s_axis_tlast;
wire                    s_axis_tready;
wire [7:0]              data_axis_tdata;
wire                    data_axis_tvalid;
wire                    data_axis_tlast;
(* anyseq *) wire       data_axis_tready;
wire                    segment_valid;
wire                    msg_valid;
(* anyseq *) wire       msg_ready;
wire                    frame_error;
wire [3:0]              frame_error_code;

reg is_first_cycle = 1;
always @(posedge clk) is_first_cycle <= 0;
wire rst_n   = !is_first_cycle;
wire running = rst_n;

// The source: the byte that comes next, up to the first one of the text, and the header.
reg [3:0]   place;
reg [31:0]  header;
reg         s_stalled;
reg [9:0]   s_before;
wire [9:0]  s_now = {s_axis_tlast, s_axis_tuser, s_axis_tdata};
wire        take = s_axis_tvalid && s_axis_tready;
wire        has_header = place >= 4;
wire        is_text = place == 8;
wire        is_long = header > `MAX_LENGTH;
wire        announces = take && place == 3;
wire        is_now_long = {s_axis_tdata, header[31:8]} > `MAX_LENGTH;
always @(posedge clk) begin
    s_stalled <= rst_n && s_axis_tvalid && !s_axis_tready;
    s_before  <= s_now;
    if (!rst_n) begin
        place  <= 0;
        header <= 0;
    end else if (take) begin
        place <= s_axis_tlast ? 0 : place + !is_text;
        if (!has_header) header <= {s_axis_tdata, header[31:8]};
    end
end
always @* if (running && s_stalled) assume (s_axis_tvalid && s_now == s_before);
always @* assume (!s_axis_tuser || s_axis_tlast);
always @* if (s_axis_tvalid && is_text) assume (s_axis_tdata[7] == is_long);

axis_to_std_msgs_string dut (
    .clk(clk),
    .rst_n(rst_n),
    .s_axis_tdata(s_axis_tdata),
    .s_axis_tkeep(1'b1),
    .s_axis_tuser(s_axis_tuser),
    .s_axis_tvalid(s_axis_tvalid),
    .s_axis_tlast(s_axis_tlast),
    .s_axis_tready(s_axis_tready),
    .data_axis_tdata(data_axis_tdata),
    .data_axis_tvalid(data_axis_tvalid),
    .data_axis_tlast(data_axis_tlast),
    .data_axis_tready(data_axis_tready),
    .segment_valid(segment_valid),
    .msg_valid(msg_valid),
    .msg_ready(msg_ready),
    .frame_error(frame_error),
    .frame_error_code(frame_error_code));

// Frames whose header is too long, their reports, and frames with a legal header.
reg [2:0] long_frames;
reg [2:0] reports;
reg [2:0] legal_frames;
reg [2:0] messages;
wire      is_report = frame_error && frame_error_code == TOO_LONG;
always @(posedge clk)
    if (!rst_n) begin
        long_frames  <= 0;
        reports      <= 0;
        legal_frames <= 0;
        messages     <= 0;
    end else begin
        long_frames  <= long_frames + (announces && is_now_long);
        legal_frames <= legal_frames + (announces && !is_now_long);
        reports      <= reports + is_report;
        messages     <= messages + (msg_valid && msg_ready);
    end

// Cycles on end in which everything was taken, and nothing moved.
reg [2:0] quiet;
always @(posedge clk)
    quiet <= !rst_n || take || !data_axis_tready || !msg_ready || data_axis_tvalid || msg_valid ? 0
           : quiet + (quiet != 7);

always @* if (running) begin
    if (data_axis_tvalid) no_refused_byte_leaves: assert (!data_axis_tdata[7]);
    if (msg_valid) no_refused_message: assert (messages < legal_frames);
    if (is_report) no_report_invented: assert (reports < long_frames);
    if (quiet >= 4) each_is_reported: assert (reports == long_frames);
end

endmodule
