// SPDX-License-Identifier: Apache-2.0
// The services with which clients of ROS 2 list, describe, read and set the parameters of a node, and the events about
// their changes (rcl_interfaces), for the parameters of the hardware. Messages are bytes in CDR. C++17.
#pragma once

#include <chrono>
#include <cstdint>
#include <cstring>
#include <functional>
#include <stdexcept>
#include <string>
#include <utility>
#include <vector>

#include <firm/log.hpp>
#include <firm/parameters.hpp>
#include <firm/services.hpp>
#include <firm/topic.hpp>
#include <firm/transport.hpp>

namespace firm {

// Reads a message in little-endian CDR. Throws std::out_of_range at its end.
class CdrReader {
 public:
  explicit CdrReader(const Bytes& bytes) : bytes_(bytes) {}

  template <typename Number>
  Number number() {
    place_ += (kHeader - place_) % sizeof(Number);
    if (bytes_.size() < place_ + sizeof(Number)) throw std::out_of_range("the message is too short");
    Number found;
    std::memcpy(&found, bytes_.data() + place_, sizeof found);
    place_ += sizeof found;
    return found;
  }

  std::string text() {
    const std::size_t size = number<std::uint32_t>();
    if (size == 0 || bytes_.size() - place_ < size) throw std::out_of_range("the message is too short");
    const std::string found(reinterpret_cast<const char*>(bytes_.data()) + place_, size - 1);
    place_ += size;
    return found;
  }

  template <typename Skip>
  void skip(Skip element) {
    for (std::uint32_t left = number<std::uint32_t>(); left > 0; --left) element();
  }

 private:
  static constexpr std::size_t kHeader = 4;
  const Bytes& bytes_;
  std::size_t place_ = kHeader;
};

// Writes a message in little-endian CDR.
class CdrWriter {
 public:
  template <typename Number>
  CdrWriter& number(Number value) {
    while ((bytes.size() - kHeader) % sizeof(Number) != 0) bytes.push_back(0);
    std::uint8_t raw[sizeof(Number)];
    std::memcpy(raw, &value, sizeof value);
    bytes.insert(bytes.end(), raw, raw + sizeof raw);
    return *this;
  }

  CdrWriter& text(const std::string& value) {
    number(static_cast<std::uint32_t>(value.size() + 1));
    bytes.insert(bytes.end(), value.begin(), value.end());
    bytes.push_back(0);
    return *this;
  }

  // Write the time as builtin_interfaces/msg/Time.
  CdrWriter& now() {
    const auto since = std::chrono::system_clock::now().time_since_epoch();
    const auto seconds = std::chrono::duration_cast<std::chrono::seconds>(since);
    const auto rest = std::chrono::duration_cast<std::chrono::nanoseconds>(since - seconds);
    return number(static_cast<std::int32_t>(seconds.count())).number(static_cast<std::uint32_t>(rest.count()));
  }

  CdrWriter& count(std::size_t value) { return number(static_cast<std::uint32_t>(value)); }

  Bytes bytes{0, 1, 0, 0};

 private:
  static constexpr std::size_t kHeader = 4;
};

// The parameter services of a node.
class ParameterServices {
 public:
  ParameterServices(HardwareParameters& parameters, SetParameters set)
      : parameters_(parameters), set_(std::move(set)) {}

  // Serve all; `serve` passes the requests of a service to a handler. Publish an event for the values in effect, and one
  // for each change. The object outlives the services.
  void open(const std::string& node, const std::function<void(const Service&, CallHandler)>& serve,
            MessageHandler publish_event) {
    node_ = node;
    publish_event_ = std::move(publish_event);
    const auto add = [&](const std::string& name, const std::string& type, Bytes (ParameterServices::*respond)(CdrReader)) {
      Service service{};
      service.name = node + "/" + name;
      service.type = "rcl_interfaces/srv/" + type;
      service.request_type = service.type + "_Request";
      service.response_type = service.type + "_Response";
      serve(service, [this, respond](const Bytes& request, const AnswerHandler& answer) {
        try {
          answer({(this->*respond)(CdrReader(request))});
        } catch (const std::out_of_range& fault) {
          answer({std::nullopt, fault.what()});
        }
      });
    };
    add("list_parameters", "ListParameters", &ParameterServices::list);
    add("describe_parameters", "DescribeParameters", &ParameterServices::describe);
    add("get_parameter_types", "GetParameterTypes", &ParameterServices::types);
    add("get_parameters", "GetParameters", &ParameterServices::get);
    add("set_parameters", "SetParameters", &ParameterServices::set);
    add("set_parameters_atomically", "SetParametersAtomically", &ParameterServices::set_atomically);
    publish(parameters_.values(), {});
  }

 private:
  // The types of rcl_interfaces/msg/ParameterType.
  enum Type : std::uint8_t { kNotSet, kBool, kInteger, kDouble };

  static Type type_of(const Parameter& parameter) {
    return parameter.is_bool() ? kBool : parameter.is_float() ? kDouble : kInteger;
  }

  const Parameter* find(const std::string& name) const {
    for (const auto& parameter : parameters_.parameters()) {
      if (parameter.name == name) return &parameter;
    }
    return nullptr;
  }

  static std::vector<std::string> names(CdrReader& request) {
    std::vector<std::string> found;
    request.skip([&] { found.push_back(request.text()); });
    return found;
  }

  // Publish an event, a rcl_interfaces/msg/ParameterEvent, with the values in effect of new and of changed parameters.
  void publish(const HardwareParameters::Values& added, const HardwareParameters::Values& changed) const {
    CdrWriter event;
    event.now().text(node_);
    for (const auto* values : {&added, &changed}) {
      event.count(values->size());
      for (const auto& item : *values) {
        event.text(item.first);
        write_value(event, item.first);
      }
    }
    event.count(0);  // none is deleted
    try {
      publish_event_(event.bytes.data(), event.bytes.size());
    } catch (const MiddlewareError& error) {
      node_log().say(Level::kWarning, error.what());
    }
  }

  // A value's numbers, then the strings and arrays, which are empty.
  void write_value(CdrWriter& out, const std::string& name) const {
    const Parameter* parameter = find(name);
    const auto value = parameter ? parameters_.values().at(name) : ParameterValue(false);
    out.number<std::uint8_t>(parameter ? type_of(*parameter) : kNotSet);
    out.number<std::uint8_t>(std::holds_alternative<bool>(value) && std::get<bool>(value));
    out.number<std::int64_t>(std::holds_alternative<std::int64_t>(value) ? std::get<std::int64_t>(value) : 0);
    out.number<double>(std::holds_alternative<double>(value) ? std::get<double>(value) : 0.0);
    out.text("");
    for (int arrays = 5; arrays > 0; --arrays) out.count(0);
  }

  // Return the name and the value of a parameter; a value of another type is a bool where none is legal.
  std::pair<std::string, std::pair<Type, ParameterValue>> read_parameter(CdrReader& request) const {
    const std::string name = request.text();
    const auto type = static_cast<Type>(request.number<std::uint8_t>());
    const bool truth = request.number<std::uint8_t>() != 0;
    const auto integer = request.number<std::int64_t>();
    const auto real = request.number<double>();
    request.text();
    request.skip([&] { request.number<std::uint8_t>(); });
    request.skip([&] { request.number<std::uint8_t>(); });
    request.skip([&] { request.number<std::int64_t>(); });
    request.skip([&] { request.number<double>(); });
    request.skip([&] { request.text(); });
    const ParameterValue value = type == kInteger ? ParameterValue(integer) : type == kDouble ? real : ParameterValue(truth);
    return {name, {type, value}};
  }

  Bytes list(CdrReader request) {
    const auto prefixes = names(request);
    CdrWriter out;
    std::vector<std::string> found;
    for (const auto& parameter : parameters_.parameters()) {
      bool is_wanted = prefixes.empty();
      for (const auto& prefix : prefixes) {
        is_wanted = is_wanted || parameter.name == prefix || parameter.name.rfind(prefix + ".", 0) == 0;
      }
      if (is_wanted) found.push_back(parameter.name);
    }
    out.count(found.size());
    for (const auto& name : found) out.text(name);
    out.count(0);
    return out.bytes;
  }

  Bytes describe(CdrReader request) {
    CdrWriter out;
    const auto wanted = names(request);
    out.count(wanted.size());
    for (const auto& name : wanted) {
      const Parameter* parameter = find(name);
      out.text(name).number<std::uint8_t>(parameter ? type_of(*parameter) : kNotSet);
      out.text(parameter ? parameter->type + " of an accelerator: " + parameter->range() : "").text("");
      out.number<std::uint8_t>(0).number<std::uint8_t>(0);  // neither read-only nor of any type
      const bool is_real = parameter && parameter->is_float();
      const bool is_whole = parameter && !parameter->is_float() && !parameter->is_bool();
      out.count(is_real);
      if (is_real) out.number(parameter->least).number(parameter->most).number(0.0);
      out.count(is_whole);
      if (is_whole) {
        out.number(static_cast<std::int64_t>(parameter->least)).number(static_cast<std::int64_t>(parameter->most));
        out.number<std::uint64_t>(0);
      }
    }
    return out.bytes;
  }

  Bytes types(CdrReader request) {
    CdrWriter out;
    const auto wanted = names(request);
    out.count(wanted.size());
    for (const auto& name : wanted) {
      const Parameter* parameter = find(name);
      out.number<std::uint8_t>(parameter ? type_of(*parameter) : kNotSet);
    }
    return out.bytes;
  }

  Bytes get(CdrReader request) {
    CdrWriter out;
    const auto wanted = names(request);
    out.count(wanted.size());
    for (const auto& name : wanted) write_value(out, name);
    return out.bytes;
  }

  using Wanted = std::vector<std::pair<std::string, std::pair<Type, ParameterValue>>>;

  // Set values, all or none. Report why they are refused, and return the reason, or an empty text.
  std::string set_all(const Wanted& wanted) {
    const std::string reason = tried(wanted);
    if (reason.empty()) return "";
    std::string names;
    for (const auto& item : wanted) names += (names.empty() ? "" : ", ") + item.first;
    node_log().say(Level::kWarning, "the parameter " + names + " is not set: " + reason);
    return reason;
  }

  // Return why values are not set, or an empty text.
  std::string tried(const Wanted& wanted) {
    HardwareParameters::Values values;
    for (const auto& [name, typed] : wanted) {
      const Parameter* parameter = find(name);
      if (!parameter) return "there is no parameter '" + name + "'";
      // As for other nodes of ROS 2, the type is that of the declaration.
      if (typed.first != type_of(*parameter)) return "the value is not a " + parameter->type + "; legal: " + parameter->range();
      values[name] = typed.second;
    }
    const std::string reason = set_(values);
    if (reason.empty()) publish({}, values);
    return reason;
  }

  static void write_result(CdrWriter& out, const std::string& reason) {
    out.number<std::uint8_t>(reason.empty()).text(reason);
  }

  Bytes set(CdrReader request) {
    CdrWriter out;
    std::vector<std::string> reasons;
    request.skip([&] { reasons.push_back(set_all({read_parameter(request)})); });
    out.count(reasons.size());
    for (const auto& reason : reasons) write_result(out, reason);
    return out.bytes;
  }

  Bytes set_atomically(CdrReader request) {
    CdrWriter out;
    Wanted wanted;
    request.skip([&] { wanted.push_back(read_parameter(request)); });
    write_result(out, set_all(wanted));
    return out.bytes;
  }

  HardwareParameters& parameters_;
  const SetParameters set_;
  std::string node_;
  MessageHandler publish_event_;
};

}  // namespace firm
