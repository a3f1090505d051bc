// Bench of an accelerator for sensor_msgs/Image, translated by Verilator: sends one message as fast as it is taken,
// takes what comes as fast as it comes, and counts the cycles. LANES are the bytes of a beat.
//
//   bench FRAME_ID ENCODING HEIGHT WIDTH STEP DATA RESULT
//
// DATA and RESULT are files. The output is "<height> <width> <step> <encoding> <frame_id>", then the numbers of the
// cycles in which the first and the last beat of data came in, those in which they went out, and the message's cycles.
#include "Vimage.h"

#include "bench.h"

struct Stream {
  std::vector<uint8_t> bytes;
  std::size_t place = 0;
  uint64_t first = 0, last = 0;

  std::size_t beat() const { return std::min<std::size_t>(LANES, bytes.size() - place); }
  bool is_over() const { return place == bytes.size(); }
  void moved() {
    if (!place) first = cycle;
    last = cycle;
  }
  template <typename Data, typename Keep> void show(Data& tdata, Keep& tkeep, uint8_t& tvalid, uint8_t& tlast) {
    tvalid = !is_over();
    if (!tvalid) return;
    set(tdata, std::vector<uint8_t>(bytes.begin() + place, bytes.begin() + place + beat()));
    const uint64_t ones = beat() == 64 ? ~0ull : (1ull << beat()) - 1;
    tkeep = static_cast<Keep>(ones);
    tlast = place + beat() == bytes.size();
  }
  void taken(bool is_ready) {
    if (is_over() || !is_ready) return;
    moved();
    place += beat();
  }
  template <typename Data, typename Keep> void take(const Data& tdata, const Keep& tkeep, bool is_valid) {
    if (!is_valid) return;
    moved();
    for (unsigned lane = 0; lane < LANES && (static_cast<uint64_t>(tkeep) >> lane & 1); ++lane)
      bytes.push_back(byte_of(tdata, lane));
    place = bytes.size();
  }
};

#define SHOW(stream, port) \
  stream.show(port##_axis_tdata, port##_axis_tkeep, port##_axis_tvalid, port##_axis_tlast)
#define TAKEN(stream, port) stream.taken(port##_axis_tready && port##_axis_tvalid)
#define TAKE(stream, port) stream.take(port##_axis_tdata, port##_axis_tkeep, port##_axis_tvalid)

static Stream text(const char* letters) {
  Stream stream;
  stream.bytes.assign(letters, letters + std::char_traits<char>::length(letters));
  return stream;
}

static std::string words(const Stream& stream) { return std::string(stream.bytes.begin(), stream.bytes.end()); }

int main(int count, char** arguments) {
  if (count != 8) fail("seven arguments are needed");
  Stream frame_id = text(arguments[1]), encoding = text(arguments[2]), data;
  data.bytes = read_strings(arguments[6]).at(0);
  Stream got_frame_id, got_encoding, got_data;
  Vimage top;
  top.in_segment_valid = 0;
  top.in_msg_valid = 0;
  top.out_msg_ready = 0;
  reset(top);
  cycle = 0;
  top.in_header_frame_id_length = frame_id.bytes.size();
  top.in_encoding_length = encoding.bytes.size();
  top.in_height = std::strtoul(arguments[3], nullptr, 0);
  top.in_width = std::strtoul(arguments[4], nullptr, 0);
  top.in_step = std::strtoul(arguments[5], nullptr, 0);
  top.in_data_length = data.bytes.size();
  top.out_header_frame_id_axis_tready = top.out_encoding_axis_tready = top.out_data_axis_tready = 1;
  uint64_t beat = 0;
  for (bool is_over = false; !is_over; ++cycle) {
    if (cycle - beat > WATCHDOG) fail("nothing moves");
    top.in_segment_valid = 7;
    SHOW(frame_id, top.in_header_frame_id);
    if (frame_id.is_over()) SHOW(encoding, top.in_encoding);
    if (encoding.is_over()) SHOW(data, top.in_data);
    top.in_msg_valid = data.is_over();
    top.out_msg_ready = 0;
    top.clk = 0;
    top.eval();
    top.out_msg_ready = top.out_msg_valid;
    top.eval();
    is_over = top.out_msg_valid;
    const bool moves = (top.in_data_axis_tvalid && top.in_data_axis_tready) || top.out_data_axis_tvalid;
    if (moves) beat = cycle;
    TAKEN(frame_id, top.in_header_frame_id);
    TAKEN(encoding, top.in_encoding);
    TAKEN(data, top.in_data);
    TAKE(got_frame_id, top.out_header_frame_id);
    TAKE(got_encoding, top.out_encoding);
    TAKE(got_data, top.out_data);
    const bool is_right = top.out_data_length == got_data.bytes.size() &&
                          top.out_encoding_length == got_encoding.bytes.size() &&
                          top.out_header_frame_id_length == got_frame_id.bytes.size();
    if (is_over && !is_right) fail("a stream has another length than its port says");
    top.clk = 1;
    top.eval();
  }
  std::FILE* file = std::fopen(arguments[7], "wb");
  const std::size_t size = got_data.bytes.size();
  if (!file || std::fwrite(got_data.bytes.data(), 1, size, file) != size) fail("the result cannot be written");
  std::fclose(file);
  std::printf("%u %u %u ", top.out_height, top.out_width, top.out_step);
  std::printf("%s %s\n", words(got_encoding).c_str(), words(got_frame_id).c_str());
  for (const Stream* stream : {&data, &got_data})
    std::printf("%llu %llu ", number(stream->first), number(stream->last));
  std::printf("%llu\n", number(cycle));
}
