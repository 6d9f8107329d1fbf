#include "understory/cli/terminal.h"

#include <fmt/format.h>
#include <sys/ioctl.h>
#include <unistd.h>

#include <chrono>
#include <cmath>
#include <csignal>
#include <cstdio>
#include <map>
#include <memory>
#include <mutex>
#include <string_view>

#include "understory/cli/command.h"
#include "understory/util/fixed_text.h"

namespace understory {
namespace {

// A signal handler can reach nothing but static storage.
volatile std::sig_atomic_t stop_signal = 0;  // NOLINT: the globals of the program are this

volatile std::sig_atomic_t at_once = 0;  // NOLINT: and this one beside it

void on_stop_signal(int signal) {
  if (stop_signal != 0) _exit(128 + signal);
  if (at_once != 0) {
    constexpr std::string_view kSaid = "warning: stopped by the user: there is no result\n";
    (void)!::write(STDERR_FILENO, kSaid.data(), kSaid.size());
    _exit(kExitUntrusted);
  }
  stop_signal = 1;
}

std::string clock_text(double seconds) {
  const int s = static_cast<int>(std::lround(seconds));
  return s < 3600 ? fmt::format("{}:{:02}", s / 60, s % 60)
                  : fmt::format("{}:{:02}:{:02}", s / 3600, s / 60 % 60, s % 60);
}

// Columns of the terminal behind stderr; a line that is longer would wrap, and what wrapped cannot
// be cleared again. 0: unknown.
std::size_t terminal_columns() {
  winsize size{};
  return ioctl(STDERR_FILENO, TIOCGWINSZ, &size) == 0 ? size.ws_col : 0;
}

class ProgressLine {
 public:
  explicit ProgressLine(bool terminal) : terminal_(terminal) {}

  void report(const ProgressReport& report) {
    const std::lock_guard lock(mutex_);
    const auto now = std::chrono::steady_clock::now();
    const auto [at, begins] = stages_.try_emplace(report.stage);
    Stage& stage = at->second;
    if (begins) {
      stage.start = now;
      stage.start_done = report.done;
    }
    // A stage that comes back after others keeps its pace.
    const bool finished = report.total > 0.0 && report.done >= report.total;
    const auto interval = terminal_ ? std::chrono::milliseconds(200) : std::chrono::seconds(10);
    const bool due = begins || now - stage.shown >= interval || (finished && !stage.finished);
    if (!due) return;
    stage.finished = finished;
    std::string line =
        text(report, stage, std::chrono::duration<double>(now - stage.start).count());
    if (line == last_) return;
    stage.shown = now;
    show(report.stage, line);
  }

 private:
  struct Stage {
    std::chrono::steady_clock::time_point start;
    std::chrono::steady_clock::time_point shown;
    double start_done = 0.0;
    bool finished = false;
  };

  void show(const std::string& stage, const std::string& line) {
    if (!terminal_) {
      std::fputs((line + "\n").c_str(), stderr);
    } else {
      if (stage != on_line_ && !on_line_.empty()) std::fputs("\n", stderr);
      const std::size_t columns = terminal_columns();
      const bool fits = columns < 2 || line.size() < columns;
      std::fputs(("\r\x1b[K" + (fits ? line : line.substr(0, columns - 1))).c_str(), stderr);
    }
    std::fflush(stderr);
    on_line_ = stage;
    last_ = line;
  }

  static std::string text(const ProgressReport& report, const Stage& stage, double elapsed) {
    std::string line = report.stage;
    if (report.total > 0.0) line += fmt::format(" {:3.0f} %", 100.0 * report.done / report.total);
    if (report.unit.empty()) line += " ...";
    const bool said = report.unit.empty() || (report.unit == "%" && report.total > 0.0);
    if (!said) line += fmt::format("  {:.0f} {}", report.done, report.unit);
    const double rate = elapsed > 0.5 ? (report.done - stage.start_done) / elapsed : 0.0;
    if (rate > 0.0) {
      line += fmt::format("  {:.1f}/s", rate);
      if (report.total > report.done) {
        line += "  " + clock_text((report.total - report.done) / rate) + " left";
      }
    }
    if (!report.remark.empty()) line += "  " + report.remark;
    return line;
  }

  bool terminal_;
  std::mutex mutex_;
  std::map<std::string, Stage> stages_;
  std::string on_line_;  // stage of the last line
  std::string last_;
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

void stop_at_once() {
  at_once = 1;
}

std::string number_row(std::initializer_list<double> values, int decimals, const char* separator) {
  std::string row;
  for (const double value : values)
    row += (row.empty() ? "" : separator) + fixed_text(value, decimals);
  return row;
}

}  // namespace understory
