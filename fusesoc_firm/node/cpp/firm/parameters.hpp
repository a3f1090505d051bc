// SPDX-License-Identifier: Apache-2.0
// The parameters of a system's accelerators, which the node sets in the hardware by registers of the status
// (docs/reference/parameters.md). The counterpart in Python is fusesoc_firm/node/engine/hardware_parameters.py. C++17.
#pragma once

#include <chrono>
#include <cstdint>
#include <cstring>
#include <functional>
#include <map>
#include <sstream>
#include <stdexcept>
#include <string>
#include <thread>
#include <utility>
#include <variant>
#include <vector>

#include <firm/status_exchange.hpp>
#include <firm/transport.hpp>

namespace firm {

using ParameterValue = std::variant<bool, std::int64_t, double>;

// A parameter of a block; numbers of up to 32 bits are exact as double.
struct Parameter {
  std::string name;  // <block>.<name>
  std::string type;
  double initial;
  double least;
  double most;

  bool is_bool() const { return type == "bool"; }
  bool is_float() const { return type == "float32"; }

  // The legal values, for messages.
  std::string range() const {
    std::ostringstream text;
    text.precision(9);
    text << least << " to " << most;
    return is_bool() ? "true, false" : text.str();
  }

  // Return a value of the parameter's type.
  ParameterValue value(double number) const {
    if (is_bool()) return number != 0;
    return is_float() ? ParameterValue(number) : ParameterValue(static_cast<std::int64_t>(number));
  }

  // Return the value in a text. Throws std::invalid_argument.
  ParameterValue value(const std::string& text) const {
    if (text == "true") return true;
    if (text == "false") return false;
    std::istringstream stream(text);
    double number = 0;
    if (!(stream >> number) || !(stream >> std::ws).eof()) refuse(text + " is not a " + type);
    const bool is_whole = text.find_first_not_of("+-0123456789") == std::string::npos;
    return is_whole ? ParameterValue(static_cast<std::int64_t>(number)) : ParameterValue(number);
  }

  // Return a legal value with the parameter's type: a float may be given as an integer.
  ParameterValue own(const ParameterValue& legal) const {
    return value(std::visit([](auto held) { return static_cast<double>(held); }, legal));
  }

  // Return the register's word of a value. Throws std::invalid_argument, with the legal values.
  std::uint32_t word(const ParameterValue& value) const {
    const bool has_type = is_bool()    ? std::holds_alternative<bool>(value)
                          : is_float() ? !std::holds_alternative<bool>(value)
                                       : std::holds_alternative<std::int64_t>(value);
    if (!has_type) refuse("the value is not a " + type);
    double number = std::visit([](auto held) { return static_cast<double>(held); }, value);
    std::ostringstream text;
    text << number;
    // The sum has no negative zero, which the hardware orders below zero.
    if (is_float()) number = static_cast<double>(static_cast<float>(number)) + 0.0;
    if (!(number >= least && number <= most)) refuse(text.str() + " is outside of the range");
    if (!is_float()) return static_cast<std::uint32_t>(static_cast<std::int64_t>(number));
    const float single = static_cast<float>(number);
    std::uint32_t bits = 0;
    std::memcpy(&bits, &single, sizeof bits);
    return bits;
  }

 private:
  [[noreturn]] void refuse(const std::string& reason) const {
    throw std::invalid_argument(reason + "; legal: " + range());
  }
};

// The values of all parameters; the hardware begins with the defaults after each reset. `Access` is a function that
// passes a request of the status to the hardware and returns the word of the answer, or throws TransportError.
class HardwareParameters {
 public:
  using Values = std::map<std::string, ParameterValue>;
  using Access = std::function<std::uint32_t(const Bytes&)>;

  // `texts` are first values. Throws std::invalid_argument.
  HardwareParameters(const std::vector<Parameter>& parameters, const std::map<std::string, std::string>& texts)
      : parameters_(parameters) {
    for (const auto& parameter : parameters_) {
      values_[parameter.name] = parameter.value(parameter.initial);
      const auto found = texts.find(parameter.name);
      if (found == texts.end()) continue;
      try {
        const ParameterValue value = parameter.value(found->second);
        parameter.word(value);
        values_[parameter.name] = parameter.own(value);
      } catch (const std::invalid_argument& fault) {
        throw std::invalid_argument("the parameter '" + parameter.name + "' cannot be set: " + fault.what());
      }
    }
  }

  const std::vector<Parameter>& parameters() const { return parameters_; }
  const Values& values() const { return values_; }

  // Set all values in hardware after a reset. Throws TransportError.
  void restore(const Access& access) const {
    for (std::size_t number = 0; number < parameters_.size(); ++number) {
      const Parameter& parameter = parameters_[number];
      const ParameterValue& value = values_.at(parameter.name);
      if (parameter.word(value) != parameter.word(parameter.value(parameter.initial))) put(number, value, access);
    }
  }

  // Set values, all or none; return the reason why they are refused, or an empty text.
  std::string set(const Values& wanted, const Access& access) {
    try {
      for (const auto& [name, value] : wanted) parameters_.at(number_of(name)).word(value);
    } catch (const std::exception& fault) {
      return fault.what();
    }
    try {
      for (const auto& [name, value] : wanted) put(number_of(name), value, access);
    } catch (const TransportError& fault) {
      return undone(wanted, access, fault.what());
    }
    for (const auto& [name, value] : wanted) values_[name] = parameters_[number_of(name)].own(value);
    return "";
  }

  bool knows(const std::string& name) const { return values_.count(name) > 0; }

 private:
  // A value takes effect when the accelerator has accepted its message.
  static constexpr std::chrono::seconds kEffect{2};
  static constexpr std::uint32_t kWanted = 0x100, kValue = 0x104, kBytes = 8;

  std::size_t number_of(const std::string& name) const {
    for (std::size_t number = 0; number < parameters_.size(); ++number) {
      if (parameters_[number].name == name) return number;
    }
    throw std::invalid_argument("there is no parameter '" + name + "'");
  }

  static std::uint32_t address(std::uint32_t first, std::size_t number) {
    return first + kBytes * static_cast<std::uint32_t>(number);
  }

  void want(std::size_t number, const ParameterValue& value, const Access& access) const {
    access(status_request(address(kWanted, number) | kStatusWrite, parameters_[number].word(value)));
  }

  // Write a value, and wait until it is in effect. Throws TransportError if it is not, after some time.
  void put(std::size_t number, const ParameterValue& value, const Access& access) const {
    want(number, value, access);
    const auto end = std::chrono::steady_clock::now() + kEffect;
    while (access(status_request(address(kValue, number), 0)) != parameters_[number].word(value)) {
      if (std::chrono::steady_clock::now() > end) {
        throw TransportError("a message is held, so '" + parameters_[number].name + "' is not in effect");
      }
      std::this_thread::sleep_for(std::chrono::milliseconds(2));
    }
  }

  // Want the values from before; return the reason of the failure.
  std::string undone(const Values& wanted, const Access& access, const std::string& reason) const {
    try {
      for (const auto& item : wanted) want(number_of(item.first), values_.at(item.first), access);
    } catch (const TransportError& fault) {
      return reason + "; " + fault.what();
    }
    return reason;
  }

  const std::vector<Parameter> parameters_;
  Values values_;
};

// Sets values in the hardware; returns the reason why they are refused, or an empty text.
using SetParameters = std::function<std::string(const HardwareParameters::Values&)>;

}  // namespace firm
