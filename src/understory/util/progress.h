#pragma once

#include <concepts>
#include <exception>
#include <functional>
#include <string>
#include <utility>

namespace understory {

// One report of how far long work has come. `total` is 0 where the end is not known.
struct ProgressReport {
  std::string stage;   // "mapping", "writing map.laz"
  double done = 0.0;   // in `unit`
  double total = 0.0;  // in `unit`, 0 = unknown
  std::string unit;    // "s of recording", "scans"
  std::string remark;  // "3 loops", empty if nothing to say
};

// Asked between units of work; true: the user wants the work to end. May be asked from any thread.
using StopRequested = std::function<bool()>;

// The user stopped work that has no result before its end: what it wrote so far goes, what was
// there before stays. No error, so that nothing but cli/ catches it.
class Stopped : public std::exception {
 public:
  [[nodiscard]] const char* what() const noexcept override { return "stopped by the user"; }
};

// Passed into long work: takes its reports, and ends it where the user has asked for that. Called
// from the working thread, often; the receiver limits its own rate. `poll` may be called from any
// thread.
class ProgressSink {
 public:
  using Receiver = std::function<void(const ProgressReport&)>;

  ProgressSink() = default;
  template <std::invocable<const ProgressReport&> Function>
  ProgressSink(Function receiver) : receiver_(std::move(receiver)) {}  // NOLINT: as a function is

  // The same reports of work that is ended by `poll` as soon as `stop` says so.
  [[nodiscard]] ProgressSink stopped_by(StopRequested stop) const {
    ProgressSink sink = *this;
    sink.stop_ = std::move(stop);
    return sink;
  }

  // Throws Stopped if the user has asked for it. Cheap: a look at a flag.
  void poll() const {
    if (stop_ && stop_()) throw Stopped();
  }
  // Polls, too.
  void operator()(const ProgressReport& report) const {
    poll();
    if (receiver_) receiver_(report);
  }

 private:
  Receiver receiver_;
  StopRequested stop_;
};

}  // namespace understory
