#pragma once

#include <vector>

#include "understory/sensor/rig.h"
#include "understory/util/files/binary_io.h"
#include "understory/util/files/record_file.h"
#include "understory/util/time.h"

namespace understory {

// The moving part of a run whose whole state can be written and read back
// (pipeline/mapping/run_state.h). What grows with the run is in append-only files of its own in the
// work folder. The state tells how far of them it counts on.
class Resumable {
 public:
  Resumable() = default;
  Resumable(const Resumable&) = delete;
  Resumable& operator=(const Resumable&) = delete;
  virtual ~Resumable() = default;

  // Waits until its files in the work folder are on the disk, up to the point that `save` tells of.
  virtual void sync() = 0;
  virtual void save(BinaryWriter& writer) const = 0;
  // Those files, as far as `save` counts on them.
  [[nodiscard]] virtual std::vector<CountedFile> files() const = 0;
  // Instead of the events so far. Throws InputError where the bytes or the files end too early.
  virtual void load(BinaryReader& reader, const Rig& rig) = 0;
  [[nodiscard]] virtual TimeNs last_scan_end() const = 0;
};

// Two parts of a run as one. They must outlive it; the second may be missing.
class ResumablePair : public Resumable {
 public:
  ResumablePair(Resumable& first, Resumable* second) : first_(first), second_(second) {}

  void sync() override {
    first_.sync();
    if (second_ != nullptr) second_->sync();
  }
  void save(BinaryWriter& writer) const override {
    first_.save(writer);
    if (second_ != nullptr) second_->save(writer);
  }
  [[nodiscard]] std::vector<CountedFile> files() const override {
    std::vector<CountedFile> files = first_.files();
    if (second_ == nullptr) return files;
    for (const CountedFile& file : second_->files())
      files.push_back(file);
    return files;
  }
  void load(BinaryReader& reader, const Rig& rig) override {
    first_.load(reader, rig);
    if (second_ != nullptr) second_->load(reader, rig);
  }
  [[nodiscard]] TimeNs last_scan_end() const override { return first_.last_scan_end(); }

 private:
  Resumable& first_;
  Resumable* second_;
};

}  // namespace understory
