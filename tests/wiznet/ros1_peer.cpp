// A node of roscpp that sends quaternions, each after the answer to the one before:
//
//     ros1_peer SENT RECEIVED COUNT MD5_SENT MD5_RECEIVED
//
// The answer has the first 24 bytes of the quaternion. Messages are bytes here, since Debian's headers of geometry_msgs
// need not be installed.
#include <ros/ros.h>

#include <array>
#include <cstdint>
#include <cstring>
#include <iostream>
#include <string>

namespace {

template <std::size_t SIZE> struct Bytes {
  std::array<std::uint8_t, SIZE> data;
};
using Quaternion = Bytes<32>;
using Point = Bytes<24>;
std::string md5_sent, md5_received;

}  // namespace

namespace ros {
namespace message_traits {
template <> struct MD5Sum<Quaternion> {
  static const char* value() { return md5_sent.c_str(); }
  static const char* value(const Quaternion&) { return value(); }
};
template <> struct MD5Sum<Point> {
  static const char* value() { return md5_received.c_str(); }
  static const char* value(const Point&) { return value(); }
};
template <> struct DataType<Quaternion> {
  static const char* value() { return "geometry_msgs/Quaternion"; }
  static const char* value(const Quaternion&) { return value(); }
};
template <> struct DataType<Point> {
  static const char* value() { return "geometry_msgs/Point"; }
  static const char* value(const Point&) { return value(); }
};
template <std::size_t SIZE> struct Definition<Bytes<SIZE>> {
  static const char* value() { return ""; }
  static const char* value(const Bytes<SIZE>&) { return value(); }
};
}  // namespace message_traits
namespace serialization {
template <std::size_t SIZE> struct Serializer<Bytes<SIZE>> {
  template <typename Stream> static void write(Stream& stream, const Bytes<SIZE>& message) {
    std::memcpy(stream.advance(SIZE), message.data.data(), SIZE);
  }
  template <typename Stream> static void read(Stream& stream, Bytes<SIZE>& message) {
    std::memcpy(message.data.data(), stream.advance(SIZE), SIZE);
  }
  static std::uint32_t serializedLength(const Bytes<SIZE>&) { return SIZE; }
};
}  // namespace serialization
}  // namespace ros

int main(int argc, char** argv) {
  ros::init(argc, argv, "peer", ros::init_options::AnonymousName);
  const int count = std::stoi(argv[3]);
  md5_sent = argv[4];
  md5_received = argv[5];
  ros::NodeHandle node;
  Quaternion sent{};
  int answers = 0;
  ros::Publisher publisher = node.advertise<Quaternion>(argv[1], 10);
  const boost::function<void(const boost::shared_ptr<Point const>&)> take =
      [&](const boost::shared_ptr<Point const>& point) {
        answers += std::memcmp(point->data.data(), sent.data.data(), point->data.size()) == 0;
      };
  ros::Subscriber subscriber = node.subscribe<Point>(argv[2], 10, take);
  while (!publisher.getNumSubscribers() || !subscriber.getNumPublishers()) ros::WallDuration(0.02).sleep();
  ros::WallDuration(0.5).sleep();  // a publisher knows us a moment after we know it
  for (int number = 0; number < count && ros::ok(); ++number) {
    for (std::size_t index = 0; index < sent.data.size(); ++index) {
      sent.data[index] = static_cast<std::uint8_t>(number * 7 + static_cast<int>(index));
    }
    publisher.publish(sent);
    while (answers <= number && ros::ok()) {
      ros::spinOnce();
      ros::WallDuration(0.001).sleep();
    }
  }
  std::cout << answers << std::endl;
}
