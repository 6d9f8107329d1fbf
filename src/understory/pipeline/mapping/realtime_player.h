#pragma once

#include <array>
#include <chrono>
#include <condition_variable>
#include <deque>
#include <exception>
#include <memory>
#include <mutex>
#include <optional>
#include <thread>
#include <variant>

#include "understory/recording/recording.h"
#include "understory/util/progress.h"

namespace understory {

// Plays a recording at the speed of its sensors: `next` gives an event only once its time has come.
// Each stream is played by its own clock, counted from its first event, which comes at its place in
// the recording. So clocks may run years apart. A clock that jumps is followed, and a gap of more
// than `kLongestWait` is not waited for. Events wait in a queue that holds at most `max_scans`
// scans. When one more arrives, the oldest waiting scan is dropped and counted, as a sensor driver
// would. IMU and GNSS events are never dropped. One consumer thread.
class RealtimePlayer : public Recording {
 public:
  static constexpr TimeNs kLongestWait = 10 * kNsPerSecond;

  // `stop_requested` is asked while `next` waits, which then gives nothing; may be empty.
  RealtimePlayer(std::unique_ptr<Recording> source, std::size_t max_scans,
                 StopRequested stop_requested = {});
  ~RealtimePlayer() override;
  RealtimePlayer(const RealtimePlayer&) = delete;
  RealtimePlayer& operator=(const RealtimePlayer&) = delete;

  [[nodiscard]] std::optional<Event> next() override;
  // As it was when the event was read that `next` gave last.
  [[nodiscard]] const Rig& rig() const override { return *rig_; }
  [[nodiscard]] std::vector<TopicReport> topics() const override { return source_->topics(); }
  [[nodiscard]] std::string format() const override { return source_->format(); }
  [[nodiscard]] double progress() const override { return source_->progress(); }

  // Milliseconds from the moment the lidar would have delivered a scan that ended at `time`, on its
  // own clock, until now; 0 before its first scan.
  [[nodiscard]] double latency_ms(TimeNs time) const;
  [[nodiscard]] std::uint64_t dropped_scans() const;
  // Ends the playing; `next` is not to be called any more.
  void stop();

 private:
  using Clock = std::chrono::steady_clock;
  // An event with the rig as it was then.
  struct Waiting {
    Event event;
    std::shared_ptr<const Rig> rig;
  };
  // A moment of a stream's clock and of ours.
  struct Anchor {
    TimeNs time = 0;
    Clock::time_point moment;
    [[nodiscard]] Clock::time_point due(TimeNs then) const {
      return moment + std::chrono::nanoseconds(then - time);
    }
  };
  void play();
  void wait_until_due(const Event& event);
  void push(Event event);

  std::unique_ptr<Recording> source_;
  std::size_t max_scans_;
  mutable std::mutex mutex_;
  std::condition_variable changed_;
  std::deque<Waiting> queue_;
  StopRequested stop_requested_;
  std::shared_ptr<const Rig> rig_;       // of the consumer
  std::shared_ptr<const Rig> rig_read_;  // of the thread that reads
  std::size_t waiting_scans_ = 0;
  std::uint64_t dropped_ = 0;
  bool ended_ = false;
  bool stopped_ = false;
  std::exception_ptr failure_;
  std::array<std::optional<Anchor>, std::variant_size_v<Event>> anchors_;  // by the kind of event
  Clock::time_point last_due_;                                             // of the events so far
  bool started_ = false;
  std::thread thread_;  // last: starts when everything else is there
};

}  // namespace understory
