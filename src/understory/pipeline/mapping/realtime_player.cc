#include "understory/pipeline/mapping/realtime_player.h"

#include <algorithm>

namespace understory {

namespace {

using namespace std::chrono_literals;

// An event that is due so long before the one before it comes from a clock that was set back.
constexpr auto kLongestLag = 1s;
constexpr auto kAskAfter = 20ms;  // whether to stop

bool same(const Rig& a, const Rig& b) {
  return a.body_from_imu.has_value() == b.body_from_imu.has_value() &&
         a.body_from_gnss.has_value() == b.body_from_gnss.has_value() &&
         a.body_from_second_gnss.has_value() == b.body_from_second_gnss.has_value() &&
         a.lidar_model == b.lidar_model && a.body_frame == b.body_frame;
}

}  // namespace

RealtimePlayer::RealtimePlayer(std::unique_ptr<Recording> source, std::size_t max_scans,
                               StopRequested stop_requested)
    : source_(std::move(source)),
      max_scans_(max_scans),
      stop_requested_(std::move(stop_requested)),
      rig_(std::make_shared<const Rig>(source_->rig())),
      rig_read_(rig_),
      thread_([this] { play(); }) {}

RealtimePlayer::~RealtimePlayer() {
  stop();
}

void RealtimePlayer::stop() {
  {
    const std::lock_guard lock(mutex_);
    stopped_ = true;
  }
  changed_.notify_all();
  if (thread_.joinable()) thread_.join();
}

void RealtimePlayer::play() {
  try {
    while (auto event = source_->next()) {
      wait_until_due(*event);
      if (!same(*rig_read_, source_->rig()))
        rig_read_ = std::make_shared<const Rig>(source_->rig());
      const std::lock_guard lock(mutex_);
      if (stopped_) return;
      push(std::move(*event));
    }
  } catch (...) {  // handed to the consumer, who throws it again
    const std::lock_guard lock(mutex_);
    failure_ = std::current_exception();
  }
  const std::lock_guard lock(mutex_);
  ended_ = true;
  changed_.notify_all();
}

void RealtimePlayer::wait_until_due(const Event& event) {
  const TimeNs time = event_time(event);
  std::unique_lock lock(mutex_);
  if (!started_) last_due_ = Clock::now();
  started_ = true;
  std::optional<Anchor>& anchor = anchors_[event.index()];
  if (!anchor) anchor = Anchor{time, last_due_};
  // Compared before it is converted: clocks may jump by more than the computer's can count.
  const TimeNs step = time - anchor->time;
  const TimeNs since = std::chrono::nanoseconds(last_due_ - anchor->moment).count();
  if (step - since > kLongestWait || since - step > std::chrono::nanoseconds(kLongestLag).count())
    anchor = Anchor{time, last_due_};
  last_due_ = std::max(last_due_, anchor->due(time));
  changed_.wait_until(lock, anchor->due(time), [this] { return stopped_; });
}

void RealtimePlayer::push(Event event) {
  const bool is_scan = std::holds_alternative<ScanPtr>(event);
  if (is_scan && waiting_scans_ >= max_scans_) {
    const auto oldest = std::find_if(queue_.begin(), queue_.end(), [](const Waiting& e) {
      return std::holds_alternative<ScanPtr>(e.event);
    });
    queue_.erase(oldest);
    --waiting_scans_;
    ++dropped_;
  }
  queue_.push_back({std::move(event), rig_read_});
  if (is_scan) ++waiting_scans_;
  changed_.notify_all();
}

std::optional<Event> RealtimePlayer::next() {
  std::unique_lock lock(mutex_);
  while (queue_.empty() && !ended_) {
    if (stop_requested_ && stop_requested_()) return std::nullopt;
    changed_.wait_for(lock, kAskAfter);
  }
  if (queue_.empty()) {
    if (failure_) std::rethrow_exception(failure_);
    return std::nullopt;
  }
  Event event = std::move(queue_.front().event);
  rig_ = std::move(queue_.front().rig);
  queue_.pop_front();
  if (std::holds_alternative<ScanPtr>(event)) --waiting_scans_;
  return event;
}

double RealtimePlayer::latency_ms(TimeNs time) const {
  const std::lock_guard lock(mutex_);
  const std::optional<Anchor>& lidar = anchors_[0];  // the first kind of Event
  if (!lidar) return 0.0;
  return std::chrono::duration<double, std::milli>(Clock::now() - lidar->due(time)).count();
}

std::uint64_t RealtimePlayer::dropped_scans() const {
  const std::lock_guard lock(mutex_);
  return dropped_;
}

}  // namespace understory
