// A client of roscpp for sensor_msgs/SetCameraInfo, like service_peer.py:
//
//     service_client SERVICE CALLS SEED MD5
//
// It serialises requests and reads responses itself, since Debian's headers of the messages need not be installed.
#include <ros/ros.h>

#include <cstdint>
#include <cstring>
#include <iostream>
#include <random>
#include <string>
#include <vector>

namespace {

using Bytes = std::vector<std::uint8_t>;

void number(Bytes& bytes, std::uint32_t value) {
  for (int shift = 0; shift < 32; shift += 8) bytes.push_back(static_cast<std::uint8_t>(value >> shift));
}

void text(Bytes& bytes, const std::string& value) {
  number(bytes, static_cast<std::uint32_t>(value.size()));
  bytes.insert(bytes.end(), value.begin(), value.end());
}

// A CameraInfo with zeros except for width and distortion model, and `coefficients` elements in D.
Bytes request(std::uint32_t width, const std::string& model, std::uint32_t coefficients) {
  Bytes bytes(12);  // seq and stamp
  text(bytes, "camera");
  number(bytes, 480);
  number(bytes, width);
  text(bytes, model);
  number(bytes, coefficients);
  // D; K, R and P; binning and region of interest.
  bytes.resize(bytes.size() + 8 * (coefficients + 9 + 9 + 12) + 2 * 4 + 4 * 4 + 1);
  return bytes;
}

ros::SerializedMessage counted(const Bytes& bytes) {
  Bytes all;
  number(all, static_cast<std::uint32_t>(bytes.size()));
  all.insert(all.end(), bytes.begin(), bytes.end());
  boost::shared_array<std::uint8_t> buffer(new std::uint8_t[all.size()]);
  std::memcpy(buffer.get(), all.data(), all.size());
  return ros::SerializedMessage(buffer, all.size());
}

}  // namespace

int main(int argc, char** argv) {
  ros::init(argc, argv, "client", ros::init_options::AnonymousName);
  const std::string service = argv[1], md5 = argv[4];
  const int calls = std::stoi(argv[2]);
  std::mt19937 source(static_cast<std::uint32_t>(std::stoul(argv[3])));
  ros::NodeHandle node;
  // waitForService() would print to the standard output.
  while (!ros::service::exists(service, false)) ros::WallDuration(0.05).sleep();
  ros::ServiceClientOptions options(service, md5, true, ros::M_string());
  ros::ServiceClient client = node.serviceClient(options);
  std::cout << "ready" << std::endl;
  std::string line;
  std::getline(std::cin, line);
  std::string wrong, failed;
  for (int call = 0; call < calls; ++call) {
    const std::uint32_t width = source();
    const std::string model = "call " + std::to_string(call) + " of " + argv[3] + " " + std::string(source() % 40, 'x');
    ros::SerializedMessage response;
    Bytes expected{static_cast<std::uint8_t>(width & 1)};
    text(expected, model);
    const std::string item = "\"" + model + "\"";
    if (!client.call(counted(request(width, model, source() % 9)), response, md5)) {
      failed += (failed.empty() ? "" : ", ") + item;
    } else if (Bytes(response.buf.get(), response.buf.get() + response.num_bytes) != expected) {
      wrong += (wrong.empty() ? "" : ", ") + item;
    }
  }
  std::cout << "{\"wrong\": [" << wrong << "], \"failed\": [" << failed << "]}" << std::endl;
  return 0;
}
