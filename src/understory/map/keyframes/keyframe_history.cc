#include "understory/map/keyframes/keyframe_history.h"

#include <algorithm>
#include <string>
#include <system_error>
#include <utility>

#include "understory/geometry/pose_io.h"
#include "understory/map/map_constants.h"
#include "understory/util/error.h"

namespace understory {
namespace {

constexpr const char* kFile = "keyframes.bin";
constexpr std::uint64_t kPosesKept = 3;  // files of poses; two checkpoints may count on two
// Each keyframe goes in once, and brings others back.
constexpr std::size_t kMostInsertions = 1 + map_constants::returning_keyframes::kMostAtOnce;
constexpr std::size_t kPoseBytes = 7 * sizeof(double);

enum class Kind : std::uint8_t { kKeyframe = 1, kSegment = 2, kLoop = 3 };

void put_keyframe(BinaryWriter& writer, const Keyframe& keyframe) {
  writer.put(Kind::kKeyframe);
  writer.put(keyframe.stamp);
  put_pose(writer, keyframe.world_from_body);
  put_pose(writer, keyframe.previous_from_this);
  writer.put_doubles(keyframe.covariance.data(), 36);
}

Keyframe get_keyframe(BinaryReader& reader) {
  Keyframe keyframe;
  keyframe.stamp = reader.get<TimeNs>();
  keyframe.world_from_body = get_pose(reader);
  keyframe.previous_from_this = get_pose(reader);
  reader.get_doubles(keyframe.covariance.data(), 36);
  return keyframe;
}

void put_loop(BinaryWriter& writer, const LoopAttempt& attempt) {
  writer.put(Kind::kLoop);
  writer.put(attempt.from);
  writer.put(attempt.to);
  writer.put(attempt.verified);
  writer.put(attempt.correction_m);
  put_pose(writer, attempt.edge.from_from_to);
  writer.put_doubles(attempt.edge.covariance.data(), 36);
  writer.put(attempt.reason);
}

LoopAttempt get_loop(BinaryReader& reader) {
  LoopAttempt attempt;
  attempt.from = reader.get<int>();
  attempt.to = reader.get<int>();
  attempt.verified = reader.get<bool>();
  attempt.correction_m = reader.get<double>();
  attempt.edge.from = attempt.from;
  attempt.edge.to = attempt.to;
  attempt.edge.from_from_to = get_pose(reader);
  reader.get_doubles(attempt.edge.covariance.data(), 36);
  attempt.reason = reader.get_string();
  return attempt;
}

void get_record(BinaryReader& reader, const std::string& file, KeyframeGrowth& growth) {
  switch (reader.get_enum(Kind::kLoop)) {
    case Kind::kKeyframe:
      growth.keyframes.push_back(get_keyframe(reader));
      return;
    case Kind::kSegment:
      growth.segment_starts.push_back(reader.get<std::uint64_t>());
      return;
    case Kind::kLoop:
      growth.loops.push_back(get_loop(reader));
      return;
  }
  throw InputError(file, "", "expected a keyframe, a beginning of a segment or a loop");
}

void check(const KeyframeGrowth& growth, const std::string& file) {
  const std::size_t keyframes = growth.keyframes.size();
  for (const std::uint64_t start : growth.segment_starts) {
    if (start > keyframes) throw InputError(file, "", "expected segments that begin at a keyframe");
  }
  for (const LoopAttempt& loop : growth.loops) {
    const auto there = [&](int i) { return i >= 0 && static_cast<std::size_t>(i) < keyframes; };
    if (!there(loop.from) || !there(loop.to))
      throw InputError(file, "", "expected loops between keyframes that are there");
  }
  if (growth.segment_starts.empty())
    throw InputError(file, "", "expected the beginning of the first segment");
}

}  // namespace

KeyframeHistory::KeyframeHistory(std::filesystem::path folder)
    : folder_(std::move(folder)), file_(folder_ / kFile) {}

KeyframeHistory::KeyframeHistory(std::filesystem::path folder, BinaryReader& reader,
                                 KeyframeGrowth& growth)
    : folder_(std::move(folder)), file_(folder_ / kFile, reader.get<RecordCount>()) {
  growth = {};
  const std::string file = file_.path().string();
  file_.for_each([&](std::uint64_t /*offset*/, RecordFile::Bytes bytes) {
    BinaryReader record({bytes.begin(), bytes.end()}, file);
    get_record(record, file, growth);
  });
  check(growth, file);
  keyframes_ = growth.keyframes.size();
  segments_ = growth.segment_starts.size();
  loops_ = growth.loops.size();
  poses_number_ = reader.get<std::uint64_t>();
  poses_ = reader.get<RecordCount>();
  if (poses_number_ == 0) return;
  const std::filesystem::path path = poses_file(poses_number_);
  for_each_record(path, poses_, [&](std::uint64_t /*offset*/, RecordFile::Bytes bytes) {
    BinaryReader poses({bytes.begin(), bytes.end()}, path.string());
    const std::size_t count = bytes.size() / kPoseBytes;
    if (count > growth.keyframes.size())
      throw InputError(path.string(), "", "expected no more poses than keyframes");
    for (std::size_t i = 0; i < count; ++i)
      growth.keyframes[i].world_from_body = get_pose(poses);
  });
}

std::filesystem::path KeyframeHistory::poses_file(std::uint64_t number) const {
  return folder_ / ("poses." + std::to_string(number) + ".bin");
}

void KeyframeHistory::sync(const std::vector<Keyframe>& keyframes,
                           const std::vector<std::uint64_t>& segment_starts,
                           const std::vector<LoopAttempt>& loops, bool moved) {
  const auto append = [&](const auto& write) {
    BinaryWriter record;
    write(record);
    file_.append({bytes_of(record.bytes())});
  };
  for (; segments_ < segment_starts.size(); ++segments_) {
    append([&](BinaryWriter& record) {
      record.put(Kind::kSegment);
      record.put(segment_starts[segments_]);
    });
  }
  for (; keyframes_ < keyframes.size(); ++keyframes_)
    append([&](BinaryWriter& record) { put_keyframe(record, keyframes[keyframes_]); });
  for (; loops_ < loops.size(); ++loops_)
    append([&](BinaryWriter& record) { put_loop(record, loops[loops_]); });
  file_.sync();
  if (moved) write_poses(keyframes);
}

void KeyframeHistory::write_poses(const std::vector<Keyframe>& keyframes) {
  BinaryWriter poses;
  for (const Keyframe& keyframe : keyframes)
    put_pose(poses, keyframe.world_from_body);
  RecordFile file(poses_file(poses_number_ + 1));
  file.append({bytes_of(poses.bytes())});
  file.sync();
  poses_ = file.count();
  ++poses_number_;
  if (poses_number_ <= kPosesKept) return;
  std::error_code ignored;  // goes with the folder
  std::filesystem::remove(poses_file(poses_number_ - kPosesKept), ignored);
}

void KeyframeHistory::save(BinaryWriter& writer) const {
  writer.put(file_.count());
  writer.put(poses_number_);
  writer.put(poses_);
}

std::vector<CountedFile> KeyframeHistory::files() const {
  std::vector<CountedFile> files{{kFile, file_.count()}};
  if (poses_number_ > 0) files.push_back({poses_file(poses_number_).filename().string(), poses_});
  return files;
}

namespace {

// Keyframes that follow each other; of the first it is said whether it lets the local map forget,
// the others do as `rule` says.
struct Run {
  std::uint64_t keyframe = 0;
  std::uint64_t count = 0;
  std::uint32_t forget = 0;
  std::uint32_t rule = 0;  // 0: none of them; 1: every kForgetEvery-th
};

std::uint64_t forgets(std::uint32_t rule, std::uint64_t keyframe) {
  return rule == 1 && keyframe % kForgetEvery == 0 ? 1 : 0;
}

}  // namespace

void put_insertions(BinaryWriter& writer, const std::vector<LocalMapInsertion>& insertions) {
  std::vector<Run> runs;
  for (std::size_t i = 0; i < insertions.size();) {
    Run longest;
    for (const std::uint32_t rule : {0U, 1U}) {
      Run run{insertions[i].keyframe, 1, static_cast<std::uint32_t>(insertions[i].forget), rule};
      for (std::size_t k = i + 1; k < insertions.size(); ++k, ++run.count) {
        const LocalMapInsertion& next = insertions[k];
        if (next.keyframe != run.keyframe + run.count ||
            next.forget != forgets(rule, next.keyframe))
          break;
      }
      if (run.count > longest.count) longest = run;
    }
    runs.push_back(longest);
    i += longest.count;
  }
  writer.put(runs);
}

std::vector<LocalMapInsertion> get_insertions(BinaryReader& reader, std::size_t keyframes) {
  std::vector<LocalMapInsertion> insertions;
  for (const Run& run : reader.get_vector<Run>()) {
    if (run.keyframe >= keyframes || run.count > keyframes - run.keyframe ||
        run.count > kMostInsertions * keyframes - insertions.size())
      throw InputError("checkpoint", "", "expected keyframes that are there");
    for (std::uint64_t k = 0; k < run.count; ++k) {
      const std::uint64_t keyframe = run.keyframe + k;
      insertions.push_back({keyframe, k == 0 ? run.forget : forgets(run.rule, keyframe)});
    }
  }
  return insertions;
}

}  // namespace understory
