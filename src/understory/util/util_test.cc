#include <gtest/gtest.h>

#include <cmath>
#include <future>
#include <numeric>
#include <thread>

#include "understory/util/files/binary_io.h"
#include "understory/util/log.h"
#include "understory/util/parallel.h"
#include "understory/util/random.h"
#include "understory/util/timing.h"

namespace understory {
namespace {

TEST(Parallel, OrderedSumHasTheSameBitsForAnyNumberOfThreads) {
  Random random(1);
  std::vector<double> values(100'003);
  for (double& value : values)
    value = random.normal() * std::exp(10.0 * random.normal());
  const auto sum = [&] {
    return ordered_sum(values.size(), 256, 0.0, [&](double& s, std::size_t i) { s += values[i]; });
  };
  std::vector<double> sums;
  for (const int threads : {1, 2, 4})
    with_threads(threads, [&] { sums.push_back(sum()); });
  EXPECT_EQ(sums[0], sums[1]);
  EXPECT_EQ(sums[0], sums[2]);
  const double plain = std::accumulate(values.begin(), values.end(), 0.0);
  EXPECT_NEAR(sums[0], plain, 1e-9 * std::abs(plain));
}

TEST(Parallel, ForVisitsEveryIndexOnce) {
  std::vector<int> visits(10'000, 0);
  with_threads(3, [&] { parallel_for(visits.size(), 7, [&](std::size_t i) { ++visits[i]; }); });
  EXPECT_EQ(visits, std::vector<int>(10'000, 1));
}

TEST(SideWork, CountsAThreadsTimeWhileItRunsAndAfter) {
  SideWork work;
  EXPECT_EQ(work.cpu_seconds(), 0.0);
  std::promise<void> halfway;
  std::promise<void> go_on;
  std::thread worker([&] {
    const SideWork::Scope scope(work);
    const auto burn = [&] {
      const double until = work.cpu_seconds() + 0.02;
      while (work.cpu_seconds() < until) {
      }
    };
    burn();
    halfway.set_value();
    go_on.get_future().wait();
    burn();
  });
  halfway.get_future().wait();
  EXPECT_GE(work.cpu_seconds(), 0.02);
  EXPECT_LT(work.cpu_seconds(), 0.04);
  go_on.set_value();
  worker.join();
  EXPECT_GE(work.cpu_seconds(), 0.04);
  EXPECT_LT(work.cpu_seconds(), 1.0);
  EXPECT_EQ(work.cpu_seconds(), work.cpu_seconds());
}

TEST(Random, SameSeedSameNumbersOtherStreamOthers) {
  Random a(5, 1);
  Random b(5, 1);
  Random c(5, 2);
  for (int i = 0; i < 100; ++i) {
    const std::uint64_t x = a.next();
    EXPECT_EQ(x, b.next());
    EXPECT_NE(x, c.next());
  }
}

TEST(Random, NormalAndUniformHaveTheirMoments) {
  Random random(11);
  constexpr int kSamples = 200'000;
  double sum = 0.0;
  double squares = 0.0;
  double uniform = 0.0;
  for (int i = 0; i < kSamples; ++i) {
    const double x = random.normal();
    sum += x;
    squares += x * x;
    const double u = random.uniform();
    ASSERT_GE(u, 0.0);
    ASSERT_LT(u, 1.0);
    uniform += u;
  }
  EXPECT_NEAR(sum / kSamples, 0.0, 0.01);
  EXPECT_NEAR(squares / kSamples, 1.0, 0.02);
  EXPECT_NEAR(uniform / kSamples, 0.5, 0.005);
}

TEST(Log, CountsEveryWarningButPassesOnOnlyTheFirstThree) {
  std::vector<std::string> passed;
  Log log([&](LogLevel, const std::string& message) { passed.push_back(message); });
  for (int i = 0; i < 10; ++i)
    log.warn("imu.gap", "gap " + std::to_string(i));
  log.warn("a", "other");
  ASSERT_EQ(passed.size(), 5U);
  EXPECT_EQ(passed[0], "gap 0 [imu.gap]");
  const auto warnings = log.warnings();
  ASSERT_EQ(warnings.size(), 2U);
  EXPECT_EQ(warnings[1].key, "imu.gap");
  EXPECT_EQ(warnings[1].count, 10U);
  EXPECT_EQ(warnings[1].first_message, "gap 0");
}

TEST(BinaryIo, ReadsBackWhatWasWritten) {
  BinaryWriter writer;
  writer.put(42);
  writer.put(std::string("text"));
  writer.put(std::vector<double>{1.0, 2.5});
  BinaryReader reader(writer.bytes(), "state");
  EXPECT_EQ(reader.get<int>(), 42);
  EXPECT_EQ(reader.get_string(), "text");
  EXPECT_EQ(reader.get_vector<double>(), (std::vector<double>{1.0, 2.5}));
  EXPECT_TRUE(reader.at_end());
}

TEST(BinaryIo, TruncatedBytesAreAnInputErrorAtEveryLength) {
  BinaryWriter writer;
  writer.put(std::vector<int>{1, 2, 3});
  writer.put(std::string("tail"));
  for (std::size_t size = 0; size < writer.bytes().size(); ++size) {
    BinaryReader reader(writer.bytes().substr(0, size), "state");
    const auto read_all = [&] {
      static_cast<void>(reader.get_vector<int>());
      static_cast<void>(reader.get_string());
    };
    EXPECT_THROW(read_all(), InputError) << size;
  }
}

// Found by fuzzing: a byte of 50 in a bool is neither true nor false.
TEST(BinaryIo, AnEnumerationHasOneOfItsValues) {
  enum class Colour { kRed, kGreen };
  BinaryWriter writer;
  writer.put(Colour::kGreen);
  writer.put(2);
  writer.put(-1);
  BinaryReader reader(writer.bytes(), "run/checkpoint.bin");
  EXPECT_EQ(reader.get_enum(Colour::kGreen), Colour::kGreen);
  for (const char* found : {"found 2", "found -1"}) {
    try {
      static_cast<void>(reader.get_enum(Colour::kGreen));
      ADD_FAILURE() << "expected an InputError that says " << found;
    } catch (const InputError& error) {
      EXPECT_NE(std::string(error.what()).find(found), std::string::npos) << error.what();
    }
  }
}

TEST(BinaryIo, ABoolIsZeroOrOne) {
  BinaryReader reader(std::string("\x01\x00\x32", 3), "state");
  EXPECT_TRUE(reader.get<bool>());
  EXPECT_FALSE(reader.get<bool>());
  EXPECT_THROW((void)reader.get<bool>(), InputError);
}

TEST(Timing, DistributionUsesNearestRanks) {
  std::vector<double> values;
  for (int i = 100; i >= 1; --i)
    values.push_back(i);
  const Distribution d = distribution_of(values);
  EXPECT_EQ(d.count, 100U);
  EXPECT_EQ(d.p50, 50.0);
  EXPECT_EQ(d.p99, 99.0);
  EXPECT_EQ(d.max, 100.0);
  EXPECT_DOUBLE_EQ(d.mean, 50.5);
  EXPECT_EQ(distribution_of({}).max, 0.0);
}

TEST(Timing, StageTimesStayBoundedAndKeepTheTotal) {
  StageTimes times;
  for (int i = 0; i < 200'000; ++i)
    times.add("scan", 1.0, 2.0);
  EXPECT_LT(times.samples("scan").size(), 65'536U);
  EXPECT_DOUBLE_EQ(times.total_wall_ms("scan"), 200'000.0);
}

}  // namespace
}  // namespace understory
