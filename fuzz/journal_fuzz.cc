#include <algorithm>
#include <filesystem>

#include "fuzz_folder.h"
#include "understory/map/keyframes/keyframe_clouds.h"
#include "understory/map/keyframes/keyframe_history.h"
#include "understory/pipeline/run_folder/journal.h"
#include "understory/pipeline/run_folder/view_journal.h"

// The append-only files of a run: as they are, and with records whose checksums are right.
//
// Seeds are the .bin files of the runs that checkpoint_fuzz.cc names, cut to 4 kB, and their
// records once more in the form that write_records reads.
namespace understory {
namespace {

class NoSink : public ViewSink {
 public:
  void on_pose(const StampedPose& /*pose*/, bool /*positioned*/) override {}
  void on_view(const StemView& /*view*/, const SparseStep& /*step*/) override {}
  void on_fix(const GnssFix& /*fix*/) override {}
};

// Cuts the bytes into records, each as long as its first byte times `unit` says.
RecordCount write_records(const std::filesystem::path& path, RecordFile::Bytes bytes,
                          std::size_t unit) {
  RecordFile file(path);
  while (!bytes.empty()) {
    const std::size_t length = std::min<std::size_t>(bytes.size() - 1, bytes[0] * unit);
    file.append({bytes.subspan(1, length)});
    bytes = bytes.subspan(1 + length);
  }
  return file.count();
}

void read_as_it_is(const std::filesystem::path& path, RecordFile::Bytes bytes) {
  RecordCount known{bytes.size() > 2 ? bytes[1] : 1U, bytes.size(), 0};
  { RecordFile(path).append({bytes}); }
  std::filesystem::resize_file(path, bytes.size());
  expect_input_error_at_most(
      [&] { for_each_record(path, known, [](std::uint64_t, RecordFile::Bytes) {}); });
  expect_input_error_at_most([&] { const RecordFile file(path, known); });
}

void read_records(const std::filesystem::path& path, RecordFile::Bytes bytes) {
  const RecordCount known = write_records(path, bytes, 8);
  expect_input_error_at_most([&] { Journal(path, known).for_each([](const ScanRecord&) {}); });
  expect_input_error_at_most([&] {
    NoSink sink;
    const ViewJournal journal(path, known, sink);
  });
  expect_input_error_at_most([&] {
    const KeyframeClouds clouds(path, known);
    for (std::size_t i = 0; i < clouds.size(); ++i)
      (void)clouds.read(i);
  });
}

void read_history(RecordFile::Bytes bytes) {
  BinaryWriter state;
  state.put(write_records(fuzz_folder() / "keyframes.bin", bytes, 8));
  state.put(std::uint64_t{1});
  state.put(write_records(fuzz_folder() / "poses.1.bin", bytes, 56));
  expect_input_error_at_most([&] {
    BinaryReader reader(state.bytes(), "fuzz");
    KeyframeGrowth growth;
    const KeyframeHistory history(fuzz_folder(), reader, growth);
  });
  expect_input_error_at_most([&] {
    BinaryReader reader({bytes.begin(), bytes.end()}, "fuzz");
    (void)get_insertions(reader, 100);
  });
}

}  // namespace
}  // namespace understory

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  using namespace understory;
  const RecordFile::Bytes bytes(data, size);
  const std::filesystem::path path = fuzz_folder() / "records";
  read_as_it_is(path, bytes);
  read_records(path, bytes);
  read_history(bytes);
  return 0;
}
