// SPDX-License-Identifier: Apache-2.0
// The lifecycle states of a node of ROS 2: the state machine of rcl_lifecycle, which rclcpp and rclpy use as well, and
// the answers of its services. C++17; rcl_lifecycle and lifecycle_msgs are part of every ROS 2.
#pragma once

#include <lifecycle_msgs/msg/state.h>
#include <lifecycle_msgs/msg/transition_description.h>
#include <lifecycle_msgs/srv/change_state.h>
#include <lifecycle_msgs/srv/get_available_states.h>
#include <lifecycle_msgs/srv/get_available_transitions.h>
#include <lifecycle_msgs/srv/get_state.h>
#include <rcl/service.h>
#include <rcl_lifecycle/rcl_lifecycle.h>
#include <rosidl_runtime_c/string_functions.h>

#include <cstddef>
#include <cstdint>
#include <functional>
#include <string>
#include <utility>
#include <vector>

#include <firm/log.hpp>
#include <firm/rcl.hpp>
#include <firm/ros2_services.hpp>
#include <firm/topic.hpp>

namespace firm {

// A node that clients bring from the state `unconfigured` to `active` and back. All functions are called by the thread
// that spins.
class Lifecycle {
 public:
  // A service and the function that takes one of its requests and responds, which throws MiddlewareError.
  struct Server {
    const rcl_service_t* rcl;
    std::function<void()> take;
  };

  // `change` is called when the node becomes active or inactive; if it throws MiddlewareError, the node keeps its state.
  // Throws MiddlewareError.
  Lifecycle(rcl_node_t& node, std::function<void(bool is_active)> change) : node_(node), change_(std::move(change)) {
    const rcl_lifecycle_state_machine_options_t options = rcl_lifecycle_get_default_state_machine_options();
    const auto* transitions = service_support(type_of("srv/GetAvailableTransitions"));
    check_rcl(rcl_lifecycle_state_machine_init(
                  &machine_, &node_, message_support(type_of("msg/TransitionEvent")),
                  service_support(type_of("srv/ChangeState")), service_support(type_of("srv/GetState")),
                  service_support(type_of("srv/GetAvailableStates")), transitions, transitions, &options),
              "become a node with lifecycle states");
    rcl_lifecycle_com_interface_t& com = machine_.com_interface;
    add<lifecycle_msgs__srv__ChangeState_Request, lifecycle_msgs__srv__ChangeState_Response>(
        com.srv_change_state, "srv/ChangeState", [this](const auto& request, auto& response) {
          response.success = is_changed(request.transition.id, request.transition.label.data);
        });
    add<lifecycle_msgs__srv__GetState_Request, lifecycle_msgs__srv__GetState_Response>(
        com.srv_get_state, "srv/GetState",
        [this](const auto&, auto& response) { write(*machine_.current_state, response.current_state); });
    add<lifecycle_msgs__srv__GetAvailableStates_Request, lifecycle_msgs__srv__GetAvailableStates_Response>(
        com.srv_get_available_states, "srv/GetAvailableStates", [this](const auto&, auto& response) {
          const auto& map = machine_.transition_map;
          check(lifecycle_msgs__msg__State__Sequence__init(&response.available_states, map.states_size));
          for (std::size_t index = 0; index < map.states_size; ++index) {
            write(map.states[index], response.available_states.data[index]);
          }
        });
    add<lifecycle_msgs__srv__GetAvailableTransitions_Request, lifecycle_msgs__srv__GetAvailableTransitions_Response>(
        com.srv_get_available_transitions, "srv/GetAvailableTransitions", [this](const auto&, auto& response) {
          const auto& state = *machine_.current_state;
          write(state.valid_transitions, state.valid_transition_size, response.available_transitions);
        });
    add<lifecycle_msgs__srv__GetAvailableTransitions_Request, lifecycle_msgs__srv__GetAvailableTransitions_Response>(
        com.srv_get_transition_graph, "srv/GetAvailableTransitions", [this](const auto&, auto& response) {
          const auto& map = machine_.transition_map;
          write(map.transitions, map.transitions_size, response.available_transitions);
        });
  }

  ~Lifecycle() { ignore(rcl_lifecycle_state_machine_fini(&machine_, &node_)); }

  Lifecycle(const Lifecycle&) = delete;
  Lifecycle& operator=(const Lifecycle&) = delete;

  const std::vector<Server>& servers() const { return servers_; }

  // Return whether a client has shut the node down.
  bool is_finalized() const { return machine_.current_state->id == lifecycle_msgs__msg__State__PRIMARY_STATE_FINALIZED; }

 private:
  static TypeName type_of(const std::string& name) {
    const std::string kind = name.substr(0, 3) == "srv" ? "service" : "message";
    return {kind, "lifecycle_msgs/" + name, "the lifecycle"};
  }

  template <typename Request, typename Response, typename Respond>
  void add(rcl_service_t& service, const std::string& type, Respond respond) {
    servers_.push_back({&service, [&service, type, respond] {
                          TypedMessage request(type_of(type + "_Request")), response(type_of(type + "_Response"));
                          rmw_request_id_t header{};
                          const rcl_ret_t result = rcl_take_request(&service, &header, request.structure());
                          if (result == RCL_RET_SERVICE_TAKE_FAILED) return rcl_reset_error();
                          check_rcl(result, "take a request to the lifecycle");
                          respond(*static_cast<const Request*>(request.structure()),
                                  *static_cast<Response*>(response.structure()));
                          // It fails if the client has ended.
                          ignore(rcl_send_response(&service, &header, response.structure()));
                        }});
  }

  // Do a transition, by its label if it has one; return whether the node has done it.
  bool is_changed(std::uint8_t id, const std::string& label) {
    const auto* wanted = label.empty() ? rcl_lifecycle_get_transition_by_id(machine_.current_state, id)
                                       : rcl_lifecycle_get_transition_by_label(machine_.current_state, label.c_str());
    if (wanted == nullptr) {
      rcl_reset_error();
      return false;
    }
    const auto number = static_cast<std::uint8_t>(wanted->id);
    check_rcl(rcl_lifecycle_trigger_transition_by_id(&machine_, number, true), "begin a transition");
    const bool is_done = is_obeyed();
    const char* result = is_done ? rcl_lifecycle_transition_success_label : rcl_lifecycle_transition_failure_label;
    check_rcl(rcl_lifecycle_trigger_transition_by_label(&machine_, result, true), "end a transition");
    return is_done;
  }

  // Do what the state of a transition requires.
  bool is_obeyed() {
    try {
      switch (machine_.current_state->id) {
        case lifecycle_msgs__msg__State__TRANSITION_STATE_ACTIVATING:
          change_(true);
          break;
        case lifecycle_msgs__msg__State__TRANSITION_STATE_DEACTIVATING:
        case lifecycle_msgs__msg__State__TRANSITION_STATE_SHUTTINGDOWN:
          change_(false);
          break;
        default:
          break;
      }
      return true;
    } catch (const MiddlewareError& error) {
      node_log().say(Level::kWarning, error.what());
      return false;
    }
  }

  static void check(bool is_allocated) {
    if (!is_allocated) throw MiddlewareError("there is no memory for the lifecycle");
  }

  // Write a state or a transition into a message.
  template <typename Item, typename Message>
  static void write(const Item& item, Message& message) {
    message.id = static_cast<std::uint8_t>(item.id);
    check(rosidl_runtime_c__String__assign(&message.label, item.label));
  }

  static void write(const rcl_lifecycle_transition_t* items, std::size_t size,
                    lifecycle_msgs__msg__TransitionDescription__Sequence& messages) {
    check(lifecycle_msgs__msg__TransitionDescription__Sequence__init(&messages, size));
    for (std::size_t index = 0; index < size; ++index) {
      write(items[index], messages.data[index].transition);
      write(*items[index].start, messages.data[index].start_state);
      write(*items[index].goal, messages.data[index].goal_state);
    }
  }

  rcl_node_t& node_;
  const std::function<void(bool)> change_;
  rcl_lifecycle_state_machine_t machine_ = rcl_lifecycle_get_zero_initialized_state_machine();
  std::vector<Server> servers_;
};

}  // namespace firm
