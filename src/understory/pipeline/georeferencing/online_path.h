#pragma once

#include <cstdint>
#include <filesystem>
#include <map>
#include <memory>
#include <string>

#include "understory/georeference/satellites/online_georeference.h"
#include "understory/georeference/satellites/split_fit.h"
#include "understory/output/run_summary.h"
#include "understory/pipeline/georeferencing/run_place.h"
#include "understory/pipeline/mapping/positioned_scan.h"
#include "understory/pipeline/run_folder/resumable.h"
#include "understory/sensor/gnss_fix.h"
#include "understory/sensor/rig.h"
#include "understory/util/files/record_file.h"

namespace understory {

// The online georeference of a run: an OnlineGeoreference from the first fix after the first scan
// on. A file in the work folder notes what it said at each scan. Not thread-safe.
class OnlinePath : public Resumable {
 public:
  explicit OnlinePath(const std::filesystem::path& work) : work_(work) {}

  // Counts until the first fix that is taken.
  void set_levelled_by(LevelledBy what) { levelled_by_ = georeference_ ? levelled_by_ : what; }
  void take(const GnssFix& fix, const Rig& rig);
  void take(const PositionedScan& scan);
  // "on the globe within 1.2 m" of the last scan; empty where it is not known.
  [[nodiscard]] std::string remark() const;

  // Writes global.csv.gz, in the coordinate system that the user wants or that is usual there.
  // Returns figures for run.json; none, and no file, where there was no fix. Throws OutputError.
  [[nodiscard]] std::map<std::string, Figure> write(const std::filesystem::path& results,
                                                    const GeoreferenceConfig& config) const;

  void sync() override;
  void save(BinaryWriter& writer) const override;
  [[nodiscard]] std::vector<CountedFile> files() const override;
  void load(BinaryReader& reader, const Rig& rig) override;
  [[nodiscard]] TimeNs last_scan_end() const override { return last_scan_end_; }

 private:
  void begin();

  std::filesystem::path work_;
  LevelledBy levelled_by_ = LevelledBy::kNothing;
  TimeNs last_scan_end_ = 0;
  std::unique_ptr<OnlineGeoreference> georeference_;  // from the first fix on
  std::unique_ptr<RecordFile> file_;
  GlobalPose last_;
};

}  // namespace understory
