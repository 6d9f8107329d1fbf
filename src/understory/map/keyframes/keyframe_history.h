#pragma once

#include <cstdint>
#include <filesystem>
#include <vector>

#include "understory/map/keyframes/keyframe.h"
#include "understory/map/local_map.h"
#include "understory/map/loop_attempt.h"
#include "understory/util/files/binary_io.h"
#include "understory/util/files/record_file.h"

namespace understory {

// What is too far away is looked for in the local map only at every so many keyframes: it means
// going over all of it.
inline constexpr std::size_t kForgetEvery = 8;

// What a KeyframeMap is made of and what grows with a run.
struct KeyframeGrowth {
  std::vector<Keyframe> keyframes;
  std::vector<std::uint64_t> segment_starts;  // first keyframe of each segment
  std::vector<LoopAttempt> loops;
};

// The same on disk, so that a checkpoint needs to hold no more than how far it has come. What is
// new is appended to keyframes.bin. What changes in old keyframes is their poses after a loop was
// closed. They are written as a whole to a file of their own (poses.1.bin, poses.2.bin ...), if
// they have changed since the last checkpoint. The last three files are kept for the checkpoints
// before. Not thread-safe. Throws OutputError where the disk is full.
class KeyframeHistory {
 public:
  // Begins anew in a work folder.
  explicit KeyframeHistory(std::filesystem::path folder);
  // Goes on from what `save` told of, and hands back what it tells. Throws InputError where the
  // files are damaged.
  KeyframeHistory(std::filesystem::path folder, BinaryReader& reader, KeyframeGrowth& growth);

  // Brings what is new onto the disk, and the poses of all keyframes if they have `moved`.
  void sync(const std::vector<Keyframe>& keyframes,
            const std::vector<std::uint64_t>& segment_starts, const std::vector<LoopAttempt>& loops,
            bool moved);
  void save(BinaryWriter& writer) const;
  [[nodiscard]] std::vector<CountedFile> files() const;

 private:
  [[nodiscard]] std::filesystem::path poses_file(std::uint64_t number) const;
  void write_poses(const std::vector<Keyframe>& keyframes);

  std::filesystem::path folder_;
  RecordFile file_;
  std::uint64_t keyframes_ = 0;  // that are in the file
  std::uint64_t segments_ = 0;
  std::uint64_t loops_ = 0;
  std::uint64_t poses_number_ = 0;  // of the last file of poses; 0: there is none
  RecordCount poses_;
};

// A list of insertions in few bytes where most of them follow each other, from `first` on.
void put_insertions(BinaryWriter& writer, const std::vector<LocalMapInsertion>& insertions);
[[nodiscard]] std::vector<LocalMapInsertion> get_insertions(BinaryReader& reader,
                                                            std::size_t keyframes);

}  // namespace understory
