#include "understory/pipeline/realtime_player.h"

#include <algorithm>

namespace understory {

RealtimePlayer::RealtimePlayer(std::unique_ptr<Recording> source, std::size_t max_scans)
    : source_(std::move(source)), max_scans_(max_scans), thread_([this] { play(); }) {}

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
      wait_until_due(event_time(*event));
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

void RealtimePlayer::wait_until_due(TimeNs time) {
  std::unique_lock lock(mutex_);
  if (!start_) start_ = {time, Clock::now()};
  const auto due = start_->second + std::chrono::nanoseconds(time - start_->first);
  changed_.wait_until(lock, due, [this] { return stopped_; });
}

void RealtimePlayer::push(Event event) {
  const bool is_scan = std::holds_alternative<ScanPtr>(event);
  if (is_scan && waiting_scans_ >= max_scans_) {
    const auto oldest = std::find_if(queue_.begin(), queue_.end(), [](const Event& e) {
      return std::holds_alternative<ScanPtr>(e);
    });
    queue_.erase(oldest);
    --waiting_scans_;
    ++dropped_;
  }
  queue_.push_back(std::move(event));
  if (is_scan) ++waiting_scans_;
  changed_.notify_all();
}

std::optional<Event> RealtimePlayer::next() {
  std::unique_lock lock(mutex_);
  changed_.wait(lock, [this] { return !queue_.empty() || ended_; });
  if (queue_.empty()) {
    if (failure_) std::rethrow_exception(failure_);
    return std::nullopt;
  }
  Event event = std::move(queue_.front());
  queue_.pop_front();
  if (std::holds_alternative<ScanPtr>(event)) --waiting_scans_;
  return event;
}

double RealtimePlayer::latency_ms(TimeNs time) const {
  const std::lock_guard lock(mutex_);
  if (!start_) return 0.0;
  const auto due = start_->second + std::chrono::nanoseconds(time - start_->first);
  return std::chrono::duration<double, std::milli>(Clock::now() - due).count();
}

std::uint64_t RealtimePlayer::dropped_scans() const {
  const std::lock_guard lock(mutex_);
  return dropped_;
}

}  // namespace understory
