// SPDX-License-Identifier: Apache-2.0
// The actions of a node, which the hardware serves or to which it sends goals. C++17, no dependencies.
//
// The behaviour equals that of fusesoc_firm/node/actions/actions.py.
#pragma once

#include <algorithm>
#include <chrono>
#include <cstddef>
#include <cstdint>
#include <functional>
#include <memory>
#include <string>
#include <utility>
#include <vector>

#include <firm/action.hpp>
#include <firm/action_client.hpp>
#include <firm/action_messages.hpp>
#include <firm/action_server.hpp>
#include <firm/log.hpp>
#include <firm/services.hpp>
#include <firm/topic.hpp>

namespace firm {

// The goals of all actions of a node, between the middleware and the hardware. Any thread may call the functions.
class NodeActions {
 public:
  NodeActions(const std::vector<Action>& actions, bool is_first, const PutPayload& put, const FaultHandler& on_fault) {
    for (const auto& action : actions) {
      if (action.is_server) {
        servers_.push_back(std::make_unique<ActionServer>(action, is_first, put, on_fault));
      } else {
        clients_.push_back(std::make_unique<ActionClient>(action, is_first, put, on_fault));
      }
      order_.push_back(action.is_server);
    }
  }

  // Exchange the goals of all actions with a middleware.
  template <typename Ros>
  void connect(Ros& ros) {
    for (const auto& server : servers_) {
      server->start(advertised(ros, server->action()));
      if constexpr (Ros::kVersion == 1) {
        subscribe_server(ros, *server);
      } else {
        serve(ros, *server);
      }
    }
    for (const auto& client : clients_) connect(ros, *client);
  }

  // Take a message of the hardware's publisher, if it belongs to an action; return whether it does.
  bool take(unsigned publisher, const std::uint8_t* data, std::size_t size) {
    const Bytes payload(data, data + size);
    for (const auto& server : servers_) {
      if (publisher == server->action().feedback) {
        server->take_feedback(payload);
        return true;
      }
      if (publisher == server->action().result) {
        server->take_result(payload);
        return true;
      }
    }
    for (const auto& client : clients_) {
      if (publisher == client->action().goal) {
        client->take_goal(payload);
        return true;
      }
      if (publisher == client->action().cancel) {
        client->take_cancel(payload);
        return true;
      }
    }
    return false;
  }

  // The hardware rejected a frame of this subscriber; an aborted result may follow.
  void refuse_goal(unsigned subscriber) {
    for (const auto& server : servers_) {
      if (server->action().goal == subscriber) server->refuse("the hardware rejected the goal", false);
    }
  }

  // The hardware ended a frame of this publisher in the middle.
  void refuse_result(unsigned publisher) {
    for (const auto& server : servers_) {
      if (server->action().result == publisher) server->refuse("the hardware aborted the result", true);
    }
  }

  // The hardware was restarted, and has lost its goals.
  void forget() {
    for (const auto& server : servers_) server->refuse("the hardware was restarted", true);
    for (const auto& client : clients_) client->forget();
  }

  // The hardware has no work.
  void rest() {
    for (const auto& server : servers_) server->rest();
  }

  // To be called several times a second.
  void tick() {
    for (const auto& server : servers_) server->tick();
    for (const auto& client : clients_) client->tick();
  }

  // Cancel the goals of the hardware. Take no more goals from clients, and wait until all have ended, or for `longest`;
  // then let the others fail.
  void drain(std::chrono::nanoseconds longest) {
    const auto latest = std::chrono::steady_clock::now() + longest;
    for (const auto& client : clients_) client->give_up();
    const auto answered = std::min(latest, std::chrono::steady_clock::now() + kAcceptTime);
    for (const auto& client : clients_) client->wait_until_canceled(answered);
    for (const auto& server : servers_) server->drain(latest);
    for (const auto& server : servers_) server->close();
    for (const auto& client : clients_) client->close();
  }

  // Return the counts of each action, in their order.
  std::vector<GoalStatistics> statistics() const {
    std::vector<GoalStatistics> found;
    auto server = servers_.begin();
    auto client = clients_.begin();
    for (const bool is_server : order_) found.push_back(is_server ? (*server++)->statistics() : (*client++)->statistics());
    return found;
  }

 private:
  // Servers of ROS 2 have to accept a goal before it can be canceled.
  static constexpr std::chrono::seconds kAcceptTime{1};

  template <typename Ros>
  static std::vector<PublishBytes> advertised(Ros& ros, const Action& action) {
    std::vector<PublishBytes> publishers;
    for (const auto& topic : action.publishers) {
      publishers.push_back([publish = ros.advertise(topic, topic.quality)](const Bytes& payload) {
        publish(payload.data(), payload.size());
      });
    }
    return publishers;
  }

  template <typename Ros>
  static void subscribe(Ros& ros, const Topic& topic, const std::function<void(const Bytes&)>& take) {
    ros.subscribe(topic, topic.quality, guarded(take));
  }

  template <typename Ros>
  static void subscribe_server(Ros& ros, ActionServer& server) {
    const auto& topics = server.action().subscribers;
    subscribe(ros, topics.at(Action::kGoal), [&server](const Bytes& goal) { server.add(goal); });
    subscribe(ros, topics.at(Action::kCancel), [&server](const Bytes& cancellation) { server.cancel(cancellation); });
  }

  template <typename Ros>
  static void serve(Ros& ros, ActionServer& server) {
    const auto& services = server.action().services;
    ros.serve(services.at(Action::kSendGoal), [&server](const Bytes& payload, AnswerHandler asker) {
      server.add(payload, std::move(asker));
    });
    ros.serve(services.at(Action::kCancelGoal), [&server](const Bytes& payload, const AnswerHandler& asker) {
      server.cancel(payload, asker);
    });
    ros.serve(services.at(Action::kGetResult), [&server](const Bytes& payload, AnswerHandler asker) {
      server.ask(payload, std::move(asker));
    });
  }

  template <typename Ros>
  static void connect(Ros& ros, ActionClient& client) {
    const Action& action = client.action();
    const auto& topics = action.subscribers;
    std::vector<CallHandler> services;
    for (const auto& service : action.services) services.push_back(ros.caller(service));
    client.start(advertised(ros, action), std::move(services));
    subscribe(ros, topics.at(Action::kFeedback), [&client](const Bytes& feedback) { client.take_feedback(feedback); });
    if constexpr (Ros::kVersion == 1) {
      subscribe(ros, topics.at(Action::kResult), [&client](const Bytes& result) { client.take_result(result); });
    }
    subscribe(ros, topics.at(Action::kStates), [&ros, &client, &topics](const Bytes& states) {
      // States enable goals. A goal that is published before the other topics are connected would be lost.
      if constexpr (Ros::kVersion == 1) {
        for (const std::size_t other : {Action::kFeedback, Action::kResult}) {
          if (!ros.has_publisher(topics.at(other))) return;
        }
        for (const Topic& given : client.action().publishers) {
          if (!ros.has_subscriber(given)) return;
        }
      }
      client.take_states(states);
    });
  }

  // Messages were not checked earlier.
  static MessageHandler guarded(const std::function<void(const Bytes&)>& take) {
    return [take](const std::uint8_t* data, std::size_t size) {
      try {
        take(Bytes(data, data + size));
      } catch (const MessageError& error) {
        node_log().say(Level::kWarning, std::string("a message of an action is ignored: ") + error.what());
      }
    };
  }

  std::vector<std::unique_ptr<ActionServer>> servers_;
  std::vector<std::unique_ptr<ActionClient>> clients_;
  std::vector<bool> order_;  // whether each action is one of a server
};

}  // namespace firm
