// sensor_msgs/Image to sensor_msgs/Image: the edges of a gray image, to the bit as model.py and rtl/sobel.vhd.
//
// A pixel enters and a pixel leaves in each step of the inner loop; the two rows before are stored.

#include <cstdint>

#include <hls_stream.h>

static const std::uint32_t FRAME_ID_BYTES = 256;
static const std::uint32_t MAX_ROWS = 65535;
static const std::uint32_t MAX_COLUMNS = 2048;
static const std::uint32_t ENCODING_BYTES = 5;
static const char ENCODING_IN[] = "mono8";

// While row y enters, row y-1 leaves; after the last row, it is read once more. `smooth` is a + 2b + c of a column's
// three pixels, and `difference` is c - a.
static void find_edges(
    std::uint32_t height, std::uint32_t width, std::uint32_t step, hls::stream<std::uint8_t> &data_in,
    hls::stream<std::uint8_t> &data_out
) {
    static std::uint8_t rows[2][MAX_COLUMNS];
    for (std::uint32_t y = 0; y <= height; y++) {
        int smooth = 0, difference = 0;
        int smooth_here = 0, difference_here = 0;
        int smooth_before = 0, difference_before = 0;
        for (std::uint32_t x = 0; x <= width; x++) {
#pragma HLS PIPELINE II=1
            // The pixels beyond the border repeat those at the border.
            if (x < width) {
                const int below = y < height ? data_in.read() : rows[(y + 1) % 2][x];
                const int middle = y > 0 ? rows[(y + 1) % 2][x] : below;
                const int above = y > 1 ? rows[y % 2][x] : middle;
                rows[y % 2][x] = std::uint8_t(below);
                smooth = above + 2 * middle + below;
                difference = below - above;
            }
            if (x == 0) {
                smooth_here = smooth;
                difference_here = difference;
            } else if (y > 0) {
                const int gx = smooth - smooth_before;
                const int gy = difference_before + 2 * difference_here + difference;
                const int edge = (gx < 0 ? -gx : gx) + (gy < 0 ? -gy : gy);
                data_out.write(std::uint8_t(edge < 255 ? edge : 255));
            }
            smooth_before = smooth_here;
            difference_before = difference_here;
            smooth_here = smooth;
            difference_here = difference;
        }
        if (y < height) {
            for (std::uint32_t k = width; k < step; k++) data_in.read();
        }
    }
}

void Sobel(
    hls::stream<std::uint32_t> &header_seq_in, hls::stream<std::uint32_t> &header_stamp_sec_in,
    hls::stream<std::uint32_t> &header_stamp_nsec_in, hls::stream<std::uint32_t> &header_frame_id_length_in,
    hls::stream<char> &header_frame_id_in, hls::stream<std::uint32_t> &height_in, hls::stream<std::uint32_t>
    &width_in, hls::stream<std::uint32_t> &encoding_length_in, hls::stream<char> &encoding_in,
    hls::stream<std::uint8_t> &is_bigendian_in, hls::stream<std::uint32_t> &step_in, hls::stream<std::uint32_t>
    &data_length_in, hls::stream<std::uint8_t> &data_in, hls::stream<std::uint32_t> &header_seq_out,
    hls::stream<std::uint32_t> &header_stamp_sec_out, hls::stream<std::uint32_t> &header_stamp_nsec_out,
    hls::stream<std::uint32_t> &header_frame_id_length_out, hls::stream<char> &header_frame_id_out,
    hls::stream<std::uint32_t> &height_out, hls::stream<std::uint32_t> &width_out, hls::stream<std::uint32_t>
    &encoding_length_out, hls::stream<char> &encoding_out, hls::stream<std::uint8_t> &is_bigendian_out,
    hls::stream<std::uint32_t> &step_out, hls::stream<std::uint32_t> &data_length_out, hls::stream<std::uint8_t>
    &data_out
) {
#pragma HLS INTERFACE mode=ap_fifo port=header_seq_in
#pragma HLS INTERFACE mode=ap_fifo port=header_stamp_sec_in
#pragma HLS INTERFACE mode=ap_fifo port=header_stamp_nsec_in
#pragma HLS INTERFACE mode=ap_fifo port=header_frame_id_length_in
#pragma HLS INTERFACE mode=ap_fifo port=header_frame_id_in
#pragma HLS INTERFACE mode=ap_fifo port=height_in
#pragma HLS INTERFACE mode=ap_fifo port=width_in
#pragma HLS INTERFACE mode=ap_fifo port=encoding_length_in
#pragma HLS INTERFACE mode=ap_fifo port=encoding_in
#pragma HLS INTERFACE mode=ap_fifo port=is_bigendian_in
#pragma HLS INTERFACE mode=ap_fifo port=step_in
#pragma HLS INTERFACE mode=ap_fifo port=data_length_in
#pragma HLS INTERFACE mode=ap_fifo port=data_in
#pragma HLS INTERFACE mode=ap_fifo port=header_seq_out
#pragma HLS INTERFACE mode=ap_fifo port=header_stamp_sec_out
#pragma HLS INTERFACE mode=ap_fifo port=header_stamp_nsec_out
#pragma HLS INTERFACE mode=ap_fifo port=header_frame_id_length_out
#pragma HLS INTERFACE mode=ap_fifo port=header_frame_id_out
#pragma HLS INTERFACE mode=ap_fifo port=height_out
#pragma HLS INTERFACE mode=ap_fifo port=width_out
#pragma HLS INTERFACE mode=ap_fifo port=encoding_length_out
#pragma HLS INTERFACE mode=ap_fifo port=encoding_out
#pragma HLS INTERFACE mode=ap_fifo port=is_bigendian_out
#pragma HLS INTERFACE mode=ap_fifo port=step_out
#pragma HLS INTERFACE mode=ap_fifo port=data_length_out
#pragma HLS INTERFACE mode=ap_fifo port=data_out
#pragma HLS INTERFACE mode=ap_ctrl_hs port=return
    // The input up to its pixels, in wire order. A longer frame_id is cut.
    const std::uint32_t seq = header_seq_in.read();
    const std::uint32_t sec = header_stamp_sec_in.read();
    const std::uint32_t nsec = header_stamp_nsec_in.read();
    std::uint32_t frame_id_length = header_frame_id_length_in.read();
    char frame_id[FRAME_ID_BYTES];
    for (std::uint32_t k = 0; k < frame_id_length; k++) {
        const char letter = header_frame_id_in.read();
        if (k < FRAME_ID_BYTES) frame_id[k] = letter;
    }
    if (frame_id_length > FRAME_ID_BYTES) frame_id_length = FRAME_ID_BYTES;
    std::uint32_t height = height_in.read();
    std::uint32_t width = width_in.read();
    const std::uint32_t letters = encoding_length_in.read();
    bool is_right = letters == ENCODING_BYTES;
    for (std::uint32_t k = 0; k < letters; k++) {
        const char letter = encoding_in.read();
        if (k < ENCODING_BYTES && letter != ENCODING_IN[k]) is_right = false;
    }
    is_bigendian_in.read();
    const std::uint32_t step = step_in.read();
    const std::uint32_t bytes = data_length_in.read();

    // A message that is not a valid image becomes an empty one; what is not read of it is dropped.
    is_right = is_right && std::uint64_t(height) * step == bytes && height <= MAX_ROWS && width <= step &&
               width <= MAX_COLUMNS;
    if (!is_right) {
        height = 0;
        width = 0;
    }

    // The lengths and fields of the output, which begins when all lengths are known.
    header_seq_out.write(seq);
    header_stamp_sec_out.write(sec);
    header_stamp_nsec_out.write(nsec);
    header_frame_id_length_out.write(frame_id_length);
    height_out.write(height);
    width_out.write(width);
    encoding_length_out.write(5);
    is_bigendian_out.write(0);
    step_out.write(width);
    data_length_out.write(height * width);

    // Its strings and its pixels, in wire order.
    for (std::uint32_t k = 0; k < frame_id_length; k++) header_frame_id_out.write(frame_id[k]);
    for (int k = 0; k < 5; k++) encoding_out.write("mono8"[k]);
    if (height > 0) find_edges(height, width, step, data_in, data_out);
}
