#include "understory/cli/terminal.h"

#include <fmt/format.h>
#include <unistd.h>

#include <chrono>
#include <cmath>
#include <csignal>
#include <cstdio>
#include <memory>
#include <mutex>

namespace understory {
namespace {

// A signal handler can reach nothing but static storage.
volatile std::sig_atomic_t stop_signal = 0;  // NOLINT: the one global of the program

void on_stop_signal(int signal) {
  if (stop_signal != 0) _exit(128 + signal);
  stop_signal = 1;
}

std::string clock_text(double seconds) {
  const int s = static_cast<int>(std::lround(seconds));
  return s < 3600 ? fmt::format("{}:{:02}", s / 60, s % 60)
                  : fmt::format("{}:{:02}:{:02}", s / 3600, s / 60 % 60, s % 60);
}

class ProgressLine {
 public:
  explicit ProgressLine(bool terminal) : terminal_(terminal) {}

  void report(const ProgressReport& report) {
    const std::lock_guard lock(mutex_);
    const auto now = std::chrono::steady_clock::now();
    if (report.stage != stage_) {
      if (terminal_ && !stage_.empty()) std::fputs("\n", stderr);
      stage_ = report.stage;
      start_ = now;
      start_done_ = report.done;
      shown_ = now - std::chrono::hours(1);
    }
    const bool finished = report.total > 0.0 && report.done >= report.total;
    const auto interval = terminal_ ? std::chrono::milliseconds(200) : std::chrono::seconds(10);
    if (now - shown_ < interval && !(finished && !finished_)) return;
    shown_ = now;
    finished_ = finished;
    std::fputs(text(report, std::chrono::duration<double>(now - start_).count()).c_str(), stderr);
    std::fflush(stderr);
  }

 private:
  [[nodiscard]] std::string text(const ProgressReport& report, double elapsed) const {
    std::string line = report.stage;
    if (report.total > 0.0) line += fmt::format(" {:3.0f} %", 100.0 * report.done / report.total);
    line += report.unit.empty() ? " ..." : fmt::format("  {:.0f} {}", report.done, report.unit);
    const double rate = elapsed > 0.5 ? (report.done - start_done_) / elapsed : 0.0;
    if (rate > 0.0) {
      line += fmt::format("  {:.1f}/s", rate);
      if (report.total > report.done) {
        line += "  " + clock_text((report.total - report.done) / rate) + " left";
      }
    }
    if (!report.remark.empty()) line += "  " + report.remark;
    return terminal_ ? "\r\x1b[K" + line : line + "\n";
  }

  bool terminal_;
  std::mutex mutex_;
  std::string stage_;
  std::chrono::steady_clock::time_point start_;
  std::chrono::steady_clock::time_point shown_;
  double start_done_ = 0.0;
  bool finished_ = false;
};

}  // namespace

Log::Sink terminal_log(bool verbose, bool quiet) {
  const bool terminal = isatty(STDERR_FILENO) != 0;
  return [verbose, quiet, terminal](LogLevel level, const std::string& message) {
    if (level == LogLevel::kDebug && !verbose) return;
    if (level == LogLevel::kInfo && quiet) return;
    std::string line = terminal ? "\r\x1b[K" : "";
    if (level == LogLevel::kWarning) line += "warning: ";
    if (level == LogLevel::kError) line += "error: ";
    std::fputs((line + message + "\n").c_str(), stderr);
  };
}

ProgressSink terminal_progress(bool quiet) {
  if (quiet) return [](const ProgressReport&) {};
  const auto line = std::make_shared<ProgressLine>(isatty(STDERR_FILENO) != 0);
  return [line](const ProgressReport& report) { line->report(report); };
}

StopRequested install_stop_handler() {
  std::signal(SIGINT, on_stop_signal);
  std::signal(SIGTERM, on_stop_signal);
  std::signal(SIGXFSZ,
              SIG_IGN);  // a file that may grow no more is an error of writing, like a full disk
  return [] { return stop_signal != 0; };
}

}  // namespace understory
