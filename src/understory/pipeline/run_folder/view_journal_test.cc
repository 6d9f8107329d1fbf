#include "understory/pipeline/run_folder/view_journal.h"

#include <gtest/gtest.h>

#include <filesystem>
#include <fstream>
#include <vector>

#include "understory/util/error.h"
#include "understory/util/files/folder_test_support.h"

namespace understory {
namespace {

namespace fs = std::filesystem;

// What a sink was told, as numbers that can be compared.
class Told : public ViewSink {
 public:
  void on_pose(const StampedPose& pose, bool positioned) override {
    numbers.insert(numbers.end(), {1.0, static_cast<double>(pose.stamp), positioned ? 1.0 : 0.0,
                                   pose.world_from_body.translation().x()});
  }
  void on_view(const StemView& view, const SparseStep& step) override {
    numbers.insert(numbers.end(),
                   {2.0, static_cast<double>(view.frame), static_cast<double>(view.stamp),
                    static_cast<double>(view.stems.back().zz), step.up.up_in_body.z(),
                    step.covariance(5, 2), static_cast<double>(step.up.stems)});
  }
  void on_fix(const GnssFix& fix) override { numbers.insert(numbers.end(), {3.0, fix.hdop}); }
  std::vector<double> numbers;
};

void tell(ViewSink& sink, int round) {
  sink.on_pose({1000 + round, Pose(Eigen::Quaterniond::Identity(), {0.1 * round, 2.0, 3.0})},
               round % 2 == 0);
  StemView view;
  view.frame = round;
  view.stamp = 5 + round;
  view.stems.resize(3);
  view.stems.back().zz = 0.25F * static_cast<float>(round);
  SparseStep step;
  step.up.up_in_body.z() = 0.9;
  step.up.stems = 7;
  step.covariance(5, 2) = 0.1 * round;
  sink.on_view(view, step);
  GnssFix fix;
  fix.hdop = 1.5 + round;
  sink.on_fix(fix);
}

class ViewJournalTest : public ::testing::Test {
 protected:
  const test::TemporaryFolder folder_;
  const fs::path path_ = folder_ / "views.bin";
};

TEST_F(ViewJournalTest, HandsBackWhatTheCheckpointKnowsAndGoesOn) {
  RecordCount known;
  {
    ViewJournal journal(path_);
    tell(journal, 1);
    known = journal.count();
    tell(journal, 2);  // after the checkpoint
  }
  Told expected;
  tell(expected, 1);
  Told told;
  {
    ViewJournal journal(path_, known, told);
    EXPECT_EQ(told.numbers, expected.numbers);
    tell(journal, 3);
    known = journal.count();
  }
  tell(expected, 3);
  Told again;
  const ViewJournal journal(path_, known, again);
  EXPECT_EQ(again.numbers, expected.numbers);
}

TEST_F(ViewJournalTest, WhatIsMissingOrDamagedIsAnInputError) {
  RecordCount known;
  {
    ViewJournal journal(path_);
    tell(journal, 1);
    known = journal.count();
  }
  Told told;
  RecordCount other = known;
  other.bytes += 1;  // there are fewer
  EXPECT_THROW(ViewJournal(path_, other, told), InputError);
  other.bytes -= 2;  // ends in the middle of a record
  EXPECT_THROW(ViewJournal(path_, other, told), InputError);
  other = known;
  other.digest += 1;  // other records
  EXPECT_THROW(ViewJournal(path_, other, told), InputError);
  std::fstream file(path_, std::ios::binary | std::ios::in | std::ios::out);
  file.seekp(-1, std::ios::end);
  file.put('x');
  file.close();
  EXPECT_THROW(ViewJournal(path_, known, told), InputError);
}

TEST_F(ViewJournalTest, AWholeRecordOfNoKnownKindIsAnInputError) {
  RecordCount known;
  {
    RecordFile file(path_);
    file.append({bytes_of(std::string("\x09 nothing"))});
    known = file.count();
  }
  Told told;
  EXPECT_THROW(ViewJournal(path_, known, told), InputError);
}

}  // namespace
}  // namespace understory
