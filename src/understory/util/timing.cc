#include "understory/util/timing.h"

#include <malloc.h>
#include <pthread.h>
#include <sys/resource.h>
#include <unistd.h>

#include <algorithm>
#include <cmath>
#include <ctime>
#include <fstream>
#include <numeric>
#include <string>

#include "understory/util/error.h"

namespace understory {
namespace {

constexpr std::size_t kKept = 65'536;

double seconds_of(clockid_t clock) {
  timespec now{};
  clock_gettime(clock, &now);
  return static_cast<double>(now.tv_sec) + 1e-9 * static_cast<double>(now.tv_nsec);
}

}  // namespace

double process_cpu_seconds() {
  return seconds_of(CLOCK_PROCESS_CPUTIME_ID);
}

// ru_maxrss begins with the peak of the process that started this one: it outlives an exec.
double peak_memory_mb() {
  std::ifstream file("/proc/self/status");
  for (std::string word; file >> word;) {
    double peak_kib = 0.0;
    if (word == "VmHWM:" && file >> peak_kib) return peak_kib * 1024.0 / 1e6;
  }
  rusage usage{};
  getrusage(RUSAGE_SELF, &usage);
  return static_cast<double>(usage.ru_maxrss) * 1024.0 / 1e6;
}

double resident_memory_mb() {
  std::ifstream file("/proc/self/statm");
  double pages = 0.0;
  double resident = 0.0;
  file >> pages >> resident;
  return resident * static_cast<double>(sysconf(_SC_PAGESIZE)) / 1e6;
}

void return_freed_memory_sooner() {
#ifdef __GLIBC__
  mallopt(M_MMAP_THRESHOLD, 1 << 20);
  mallopt(M_TRIM_THRESHOLD, 8 << 20);
  mallopt(M_TOP_PAD, 1 << 20);
  mallopt(M_ARENA_MAX, 4);  // each keeps what its threads have freed
#endif
}

void return_freed_memory() {
#ifdef __GLIBC__
  malloc_trim(0);
#endif
}

Distribution distribution_of(std::vector<double> values) {
  Distribution result;
  if (values.empty()) return result;
  std::sort(values.begin(), values.end());
  const auto rank = [&](double p) {
    const double index = std::ceil(p * static_cast<double>(values.size())) - 1.0;
    return values[static_cast<std::size_t>(std::max(index, 0.0))];
  };
  result.count = values.size();
  result.mean =
      std::accumulate(values.begin(), values.end(), 0.0) / static_cast<double>(values.size());
  result.p50 = rank(0.50);
  result.p99 = rank(0.99);
  result.max = values.back();
  return result;
}

void StageTimes::add(const std::string& stage, double wall_ms, double cpu_ms) {
  const std::lock_guard lock(mutex_);
  Series& series = series_[stage];
  series.total_wall_ms += wall_ms;
  if (series.seen++ % series.stride != 0) return;
  series.samples.push_back({static_cast<float>(wall_ms), static_cast<float>(cpu_ms)});
  if (series.samples.size() < kKept) return;
  for (std::size_t i = 0; i < kKept / 2; ++i)
    series.samples[i] = series.samples[2 * i];
  series.samples.resize(kKept / 2);
  series.stride *= 2;
}

std::vector<std::string> StageTimes::stages() const {
  const std::lock_guard lock(mutex_);
  std::vector<std::string> names;
  for (const auto& [name, series] : series_)
    names.push_back(name);
  return names;
}

std::vector<StageTimes::Sample> StageTimes::samples(const std::string& stage) const {
  const std::lock_guard lock(mutex_);
  const auto found = series_.find(stage);
  return found == series_.end() ? std::vector<Sample>{} : found->second.samples;
}

double StageTimes::total_wall_ms(const std::string& stage) const {
  const std::lock_guard lock(mutex_);
  const auto found = series_.find(stage);
  return found == series_.end() ? 0.0 : found->second.total_wall_ms;
}

ScopedTimer::ScopedTimer(StageTimes& times, std::string stage)
    : times_(times),
      stage_(std::move(stage)),
      start_(std::chrono::steady_clock::now()),
      cpu_start_(process_cpu_seconds()) {}

ScopedTimer::~ScopedTimer() {
  times_.add(stage_, wall_ms(), 1e3 * (process_cpu_seconds() - cpu_start_));
}

double ScopedTimer::wall_ms() const {
  return std::chrono::duration<double, std::milli>(std::chrono::steady_clock::now() - start_)
      .count();
}

SideWork::Scope::Scope(SideWork& work) : work_(work) {
  clockid_t clock{};
  const int failure = pthread_getcpuclockid(pthread_self(), &clock);
  UNDERSTORY_CHECK(failure == 0);
  const std::lock_guard lock(work_.mutex_);
  UNDERSTORY_CHECK(!work_.running_);
  work_.running_ = clock;
  work_.began_s_ = seconds_of(clock);
}

SideWork::Scope::~Scope() {
  const std::lock_guard lock(work_.mutex_);
  work_.finished_s_ += seconds_of(*work_.running_) - work_.began_s_;
  work_.running_.reset();
}

double SideWork::cpu_seconds() const {
  const std::lock_guard lock(mutex_);
  return running_ ? finished_s_ + seconds_of(*running_) - began_s_ : finished_s_;
}

}  // namespace understory
