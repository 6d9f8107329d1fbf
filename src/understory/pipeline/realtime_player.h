#pragma once

#include <chrono>
#include <condition_variable>
#include <deque>
#include <exception>
#include <memory>
#include <mutex>
#include <thread>

#include "understory/recording/recording.h"

namespace understory {

// Plays a recording at the speed of its sensors: `next` gives an event only once its time has come,
// counted from the first event. Events wait in a queue that holds at most `max_scans` scans; when
// one more arrives, the oldest waiting scan is dropped and counted, as a sensor driver would. IMU
// and GNSS events are never dropped. One consumer thread.
class RealtimePlayer : public Recording {
 public:
  RealtimePlayer(std::unique_ptr<Recording> source, std::size_t max_scans);
  ~RealtimePlayer() override;
  RealtimePlayer(const RealtimePlayer&) = delete;
  RealtimePlayer& operator=(const RealtimePlayer&) = delete;

  [[nodiscard]] std::optional<Event> next() override;
  [[nodiscard]] const Rig& rig() const override { return source_->rig(); }
  [[nodiscard]] std::vector<TopicReport> topics() const override { return source_->topics(); }
  [[nodiscard]] std::string format() const override { return source_->format(); }
  [[nodiscard]] double progress() const override { return source_->progress(); }

  // Milliseconds from the moment a sensor would have delivered what happened at `time` until now.
  [[nodiscard]] double latency_ms(TimeNs time) const;
  [[nodiscard]] std::uint64_t dropped_scans() const;
  // Ends the playing; `next` is not to be called any more.
  void stop();
  // The recording that is played; not to be touched before `next` has returned nothing or `stop`.
  [[nodiscard]] const Recording& played() const { return *source_; }

 private:
  using Clock = std::chrono::steady_clock;
  void play();
  void wait_until_due(TimeNs time);
  void push(Event event);

  std::unique_ptr<Recording> source_;
  std::size_t max_scans_;
  mutable std::mutex mutex_;
  std::condition_variable changed_;
  std::deque<Event> queue_;
  std::size_t waiting_scans_ = 0;
  std::uint64_t dropped_ = 0;
  bool ended_ = false;
  bool stopped_ = false;
  std::exception_ptr failure_;
  std::optional<std::pair<TimeNs, Clock::time_point>> start_;
  std::thread thread_;  // last: starts when everything else is there
};

}  // namespace understory
