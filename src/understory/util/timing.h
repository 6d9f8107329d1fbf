#pragma once

#include <chrono>
#include <cstddef>
#include <cstdint>
#include <ctime>
#include <map>
#include <mutex>
#include <optional>
#include <string>
#include <vector>

namespace understory {

// CPU time of the whole process so far, in seconds.
[[nodiscard]] double process_cpu_seconds();
// Resident memory of the process: the largest so far, and now; megabytes (1e6 bytes).
[[nodiscard]] double peak_memory_mb();
[[nodiscard]] double resident_memory_mb();
// Hands memory that has been freed back to the system where the C library would keep it. For the
// end of a stage that needed much: it takes some milliseconds.
void return_freed_memory();
// From now on what is freed goes back sooner, for a few per cent of the time.
void return_freed_memory_sooner();

// Mean, percentiles (nearest rank) and largest of a set of values; zeros for an empty set.
struct Distribution {
  std::size_t count = 0;
  double mean = 0.0;
  double p50 = 0.0;
  double p99 = 0.0;
  double max = 0.0;
};
[[nodiscard]] Distribution distribution_of(std::vector<double> values);

// Wall and CPU milliseconds of each run of each named stage. Thread-safe. Values are kept as
// floats. Memory does not grow over a working day: each stage keeps at most 65,536 of them, thinned
// evenly once it is full.
class StageTimes {
 public:
  struct Sample {
    float wall_ms = 0.0F;
    float cpu_ms = 0.0F;
  };
  void add(const std::string& stage, double wall_ms, double cpu_ms);
  [[nodiscard]] std::vector<std::string> stages() const;
  [[nodiscard]] std::vector<Sample> samples(const std::string& stage) const;
  [[nodiscard]] double total_wall_ms(const std::string& stage) const;

 private:
  struct Series {
    std::vector<Sample> samples;
    std::uint64_t seen = 0;
    std::uint64_t stride = 1;
    double total_wall_ms = 0.0;
  };
  mutable std::mutex mutex_;
  std::map<std::string, Series> series_;
};

// CPU time of work that runs beside the scan loop on a thread of its own, counted while it runs.
// What the process used less this is what the loop used. One thread at a time may work; any may
// read.
class SideWork {
 public:
  // Counts the calling thread's CPU time for as long as it lives, on that thread.
  class Scope {
   public:
    explicit Scope(SideWork& work);
    ~Scope();
    Scope(const Scope&) = delete;
    Scope& operator=(const Scope&) = delete;

   private:
    SideWork& work_;
  };
  [[nodiscard]] double cpu_seconds() const;

 private:
  mutable std::mutex mutex_;
  double finished_s_ = 0.0;
  std::optional<clockid_t> running_;  // clock of the thread that works
  double began_s_ = 0.0;              // on that clock
};

// Adds the time from construction to destruction to `times`. CPU time is the process's, so that the
// work of helper threads is counted with the stage that asked for it.
class ScopedTimer {
 public:
  ScopedTimer(StageTimes& times, std::string stage);
  ~ScopedTimer();
  ScopedTimer(const ScopedTimer&) = delete;
  ScopedTimer& operator=(const ScopedTimer&) = delete;
  [[nodiscard]] double wall_ms() const;

 private:
  StageTimes& times_;
  std::string stage_;
  std::chrono::steady_clock::time_point start_;
  double cpu_start_;
};

}  // namespace understory
