// SPDX-License-Identifier: Apache-2.0
// Results of rcl as exceptions, and the type support of messages and services, looked up at run time in the libraries of
// their packages. C++17; rcl is part of every ROS 2.
#pragma once

#include <dlfcn.h>
#include <rcl/error_handling.h>
#include <rcl/types.h>
#if __has_include(<rosidl_runtime_c/type_hash.h>)  // since Iron
#include <rosidl_runtime_c/type_hash.h>
#define FIRM_HAS_TYPE_HASH
#endif
#include <rosidl_runtime_c/message_type_support_struct.h>
#include <rosidl_runtime_c/service_type_support_struct.h>

#include <cstring>
#include <string>

#include <firm/services.hpp>
#include <firm/topic.hpp>

namespace firm {

// Throw MiddlewareError for any result except RCL_RET_OK; `what` names the attempted action.
inline void check_rcl(rcl_ret_t result, const std::string& what) {
  if (result == RCL_RET_OK) return;
  const std::string reason = rcl_get_error_string().str;
  rcl_reset_error();
  throw MiddlewareError("cannot " + what + ": " + reason);
}

// For cleanup calls, whose failure cannot be handled.
inline void ignore(rcl_ret_t) { rcl_reset_error(); }

// A type of ROS 2 of a topic or service `user`: a `kind`, such as "message", and a name, such as
// `geometry_msgs/msg/Quaternion`.
struct TypeName {
  std::string kind;
  std::string name;
  std::string user;
};

// Return the address of a symbol for a type: the symbol's name has a prefix, `package__msg__Type` and a suffix. Throws
// MiddlewareError if the package is not installed.
inline void* symbol(const TypeName& wanted, const std::string& library_suffix, const std::string& prefix,
                    const std::string& suffix) {
  const auto& [kind, type, user] = wanted;
  const std::string package = type.substr(0, type.find('/'));
  const std::string library = "lib" + package + library_suffix;
  std::string name = prefix;
  for (const char letter : type) name += letter == '/' ? "__" : std::string(1, letter);
  name += suffix;
  // Never closed: what rcl creates points into the library as long as the process runs.
  void* handle = dlopen(library.c_str(), RTLD_LAZY | RTLD_LOCAL);
  if (handle == nullptr) {
    throw MiddlewareError("the " + kind + " " + type + " of " + user + " is not installed: " + dlerror() +
                          "; source ROS and the workspace with " + package);
  }
  void* found = dlsym(handle, name.c_str());
  if (found == nullptr) {
    throw MiddlewareError(library + " does not contain the " + kind + " " + type + ", which " + user + " needs");
  }
  return found;
}

// Return the type support of a message. Throws MiddlewareError if its package is not installed.
inline const rosidl_message_type_support_t* message_support(const TypeName& type) {
  using Get = const rosidl_message_type_support_t* (*)();
  return reinterpret_cast<Get>(
      symbol(type, "__rosidl_typesupport_c.so", "rosidl_typesupport_c__get_message_type_support_handle__", ""))();
}

// Throw MiddlewareError if the hash of the installed type differs from `signature`; an empty one is unknown.
template <typename Support>
void check_hash(const Support& support, const TypeName& type, const std::string& signature) {
#ifdef FIRM_HAS_TYPE_HASH
  if (signature.empty()) return;
  rosidl_type_hash_t expected;
  if (rosidl_parse_type_hash_string(signature.c_str(), &expected) != RCUTILS_RET_OK) {
    rcl_reset_error();
    throw MiddlewareError("'" + signature + "', the signature of " + type.user + ", is not a type hash");
  }
  const rosidl_type_hash_t* installed = support.get_type_hash_func(&support);
  if (installed->version != expected.version || std::memcmp(installed->value, expected.value, sizeof expected.value) != 0) {
    throw MiddlewareError("the " + type.kind + " " + type.name +
                          " is installed in a version that differs from the hardware's (" + signature + ")");
  }
#endif
}

// Return the type support of a topic's messages. Throws MiddlewareError if the package is not installed, or if its
// definition differs from that of `topic`.
inline const rosidl_message_type_support_t* type_support(const Topic& topic) {
  const TypeName type{"message", topic.type, topic.name};
  const auto* support = message_support(type);
  check_hash(*support, type, topic.signature);
  return support;
}

// Return the type support of a service's type. Throws MiddlewareError if its package is not installed.
inline const rosidl_service_type_support_t* service_support(const TypeName& type) {
  using Get = const rosidl_service_type_support_t* (*)();
  return reinterpret_cast<Get>(
      symbol(type, "__rosidl_typesupport_c.so", "rosidl_typesupport_c__get_service_type_support_handle__", ""))();
}

// Return the type support of a service. Throws MiddlewareError like `type_support`.
inline const rosidl_service_type_support_t* service_support(const Service& service) {
  const TypeName type{"service", service.type, service.name};
  const auto* support = service_support(type);
  check_hash(*support, type, service.signature);
  return support;
}

}  // namespace firm
