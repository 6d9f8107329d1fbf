#include "understory/simulation/truth.h"

#include <fmt/format.h>
#include <gdal_priv.h>
#include <zlib.h>

#include <algorithm>
#include <array>
#include <cerrno>
#include <cmath>
#include <cstring>
#include <filesystem>
#include <fstream>
#include <iterator>
#include <map>
#include <system_error>

#include "understory/sensor/tree.h"
#include "understory/simulation/scene/true_crowns.h"
#include "understory/simulation/stand/objects.h"
#include "understory/util/angles.h"
#include "understory/util/error.h"

namespace understory {
namespace {

void write_text(const std::string& path, const std::string& text) {
  std::ofstream file(path, std::ios::binary);
  file << text;
  file.close();
  if (!file) throw OutputError(path, "cannot be written");
}

// A gzip file, filled piece by piece.
class GzipFile {
 public:
  explicit GzipFile(const std::string& path) : path_(path), file_(gzopen(path.c_str(), "wb6")) {
    if (file_ == nullptr) throw OutputError(path, "cannot be opened for writing");
  }
  ~GzipFile() {
    if (file_ != nullptr) gzclose(file_);
  }
  GzipFile(const GzipFile&) = delete;
  GzipFile& operator=(const GzipFile&) = delete;

  void write(const std::string& text) {
    good_ = good_ &&
            (text.empty() || gzwrite(file_, text.data(), static_cast<unsigned>(text.size())) > 0);
  }
  void close() {
    good_ = gzclose(file_) == Z_OK && good_;
    file_ = nullptr;
    if (!good_) throw OutputError(path_, "cannot be written");
  }

 private:
  std::string path_;
  gzFile file_;
  bool good_ = true;
};

std::string trajectory_text(const std::vector<ScanTruth>& scans) {
  std::string text;
  for (const ScanTruth& scan : scans) {
    const Eigen::Vector3d& p = scan.world_from_body.translation();
    const Eigen::Quaterniond& q = scan.world_from_body.rotation();
    text +=
        fmt::format("{} {:.9f} {:.9f} {:.9f} {:.9f} {:.9f} {:.9f} {:.9f}\n",
                    format_seconds(scan.stamp), p.x(), p.y(), p.z(), q.x(), q.y(), q.z(), q.w());
  }
  return text;
}

std::string velocity_text(const std::vector<ScanTruth>& scans) {
  std::string text = "timestamp,vx,vy,vz\n";
  for (const ScanTruth& scan : scans) {
    text += fmt::format("{},{:.9f},{:.9f},{:.9f}\n", format_seconds(scan.stamp), scan.velocity.x(),
                        scan.velocity.y(), scan.velocity.z());
  }
  return text;
}

std::string bias_text(const std::vector<ScanTruth>& scans) {
  std::string text = "timestamp,gx,gy,gz,ax,ay,az\n";
  for (const ScanTruth& scan : scans) {
    text +=
        fmt::format("{},{:.9f},{:.9f},{:.9f},{:.9f},{:.9f},{:.9f}\n", format_seconds(scan.stamp),
                    scan.gyro_bias.x(), scan.gyro_bias.y(), scan.gyro_bias.z(), scan.accel_bias.x(),
                    scan.accel_bias.y(), scan.accel_bias.z());
  }
  return text;
}

void write_returns(const std::string& path, const TruthLog& log) {
  GzipFile file(path);
  file.write("timestamp,tree_id,rings,rings_with_3,returns\n");
  std::string text;
  for (std::size_t i = 0; i < log.scans().size(); ++i) {
    const std::string stamp = format_seconds(log.scans()[i].stamp);
    text.clear();
    for (const StemReturns& stem : log.stems(i)) {
      text += fmt::format("{},{},{},{},{}\n", stamp, stem.tree, stem.rings, stem.rings_with_3,
                          stem.returns);
    }
    file.write(text);
  }
  file.close();
}

// Where the stem ends: at the top, or where it is broken off.
double stem_end_m(const GrownTree& grown) {
  return grown.broken_m > 0.0 ? grown.broken_m : grown.height_m;
}

// A scanned tree shows its own stem, of which only the diameter at breast height is known.
bool has_known_stem(const GrownTree& grown) {
  return grown.cloud.empty();
}

// Height of the ground at the uphill side of a stem above its foot.
double uphill_rise_m(const GrownTree& grown, const Terrain& terrain) {
  constexpr int kDirections = 16;
  double highest = grown.foot.z();
  for (int k = 0; k < kDirections; ++k) {
    const double turn = 2.0 * M_PI * k / kDirections;
    highest =
        std::max(highest, terrain.height(grown.foot.x() + 0.5 * grown.dbh_m * std::cos(turn),
                                         grown.foot.y() + 0.5 * grown.dbh_m * std::sin(turn)));
  }
  return highest - grown.foot.z();
}

// Over bark, from the ground to the end of the stem, in slices of a centimetre.
double stem_volume_m3(const GrownTree& grown) {
  constexpr double kVolumeSlice = 0.01;
  double volume = 0.0;
  for (double height = 0.5 * kVolumeSlice; height < stem_end_m(grown); height += kVolumeSlice)
    volume += 0.25 * M_PI * std::pow(grown.diameter(height), 2) * kVolumeSlice;
  return volume;
}

// The largest distance of the centre line from a straight one, between 0.5 and 5 m above the foot.
double sweep_m(const GrownTree& grown) {
  constexpr double kFrom = 0.5;
  constexpr double kTo = 5.0;
  if (stem_end_m(grown) < kTo) return Tree::kUnknown;
  const Eigen::Vector3d from = grown.centre(kFrom);
  const Eigen::Vector3d to = grown.centre(kTo);
  double most = 0.0;
  for (int i = 0; i <= 45; ++i) {
    const double share = i / 45.0;
    const Eigen::Vector3d centre = grown.centre(kFrom + share * (kTo - kFrom));
    most = std::max(most, (centre - from - share * (to - from)).head<2>().norm());
  }
  return most;
}

// As it grew: nothing of it is uncertain.
Tree truth_of(const GrownTree& grown, const TrueCrown& crown, const Terrain& terrain) {
  Tree tree;
  tree.id = grown.id;
  tree.x = grown.foot.x();
  tree.y = grown.foot.y();
  tree.z = grown.foot.z();
  tree.dbh_m = has_known_stem(grown)
                   ? grown.diameter(GrownTree::kBreastHeight + uphill_rise_m(grown, terrain))
                   : grown.dbh_m;
  tree.species = species_name(grown.species);
  tree.height_m = stem_end_m(grown);
  tree.lean_deg = grown.lean_deg();
  tree.dbh_sd_m = tree.x_sd_m = tree.y_sd_m = 0.0;
  if (has_known_stem(grown)) {
    tree.stem_volume_m3 = stem_volume_m3(grown);
    tree.stem_volume_sd_m3 = 0.0;
  }
  if (has_known_stem(grown)) {
    tree.sweep_m = sweep_m(grown);
    if (grown.fork_m > 0.0) tree.fork_m = grown.fork_m;
    tree.snag = grown.broken_m > 0.0 ? 1.0 : 0.0;
  }
  tree.foot_id = grown.id;
  tree.crown_base_m = crown.base_m;
  tree.crown_area_m2 = crown.area_m2;
  tree.crown_volume_m3 = crown.volume_m3;
  return tree;
}

// By decimetres, as the program writes its own.
std::string stem_curves_text(const Stand& stand) {
  constexpr double kStep = 0.1;
  std::string text = "tree_id,height_m,x,y,diameter_m\n";
  for (const GrownTree& grown : stand.trees) {
    if (!has_known_stem(grown)) continue;
    for (int i = 0; i * kStep <= stem_end_m(grown); ++i) {
      const Eigen::Vector3d centre = grown.centre(i * kStep);
      text += fmt::format("{},{:.1f},{:.4f},{:.4f},{:.5f}\n", grown.id, i * kStep, centre.x(),
                          centre.y(), grown.diameter(i * kStep));
    }
  }
  return text;
}

// Trees that were felled while the recording ran say when, by its clock.

std::string trees_text(const SimulatedWorld& world, TimeNs start, const TruthLog& log) {
  const std::vector<ScanTruth>& scans = log.scans();
  const TrueCrowns crowns(world.site.stand, world.seed);
  std::map<int, int> observations;
  for (std::size_t i = 0; i < scans.size(); ++i) {
    for (const StemReturns& stem : log.stems(i))
      ++observations[stem.tree];
  }
  std::map<int, std::string> felled;
  for (const Felling& felling : world.plan.harvest.fellings) {
    const TimeNs time = start + from_seconds(felling.grab_s);
    if (!scans.empty() && time < scans.back().stamp) felled[felling.tree] = format_seconds(time);
  }
  std::string text = tree_csv_header() + ",felled_at\n";
  for (const GrownTree& grown : world.stand.trees) {
    const auto seen = observations.find(grown.id);
    const auto cut = felled.find(grown.id);
    Tree tree = truth_of(grown, crowns.of(grown), world.terrain);
    tree.observations = seen == observations.end() ? 0 : seen->second;
    text += fmt::format("{},{}\n", tree_csv_row(tree, 1), cut == felled.end() ? "" : cut->second);
  }
  return text;
}

// Things that are no trees: where they stand at time zero, and how large they are.
std::string objects_text(const Stand& stand) {
  std::string text = "kind,x,y,z,length_m,width_m,height_m,yaw_deg,walk_m,speed_m_s\n";
  for (const StandObject& object : stand.objects) {
    text += fmt::format("{},{:.3f},{:.3f},{:.3f},{:.3f},{:.3f},{:.3f},{:.2f},{:.2f},{:.2f}\n",
                        object_name(object.kind), object.foot.x(), object.foot.y(), object.foot.z(),
                        object.size_m.x(), object.size_m.y(), object.size_m.z(),
                        object.yaw_rad / kDegree, object.walk_m, object.speed_m_s);
  }
  return text;
}

// Stumps and lying stems, each from one end to the other, along the centre line.
std::string dead_wood_text(const Stand& stand) {
  std::string text = "kind,x,y,z,x_to,y_to,z_to,diameter_m,diameter_to_m\n";
  for (const Wood& piece : stand.dead_wood) {
    const bool upright = (piece.to - piece.from).head<2>().norm() < 0.1;
    text += fmt::format("{},{:.3f},{:.3f},{:.3f},{:.3f},{:.3f},{:.3f},{:.3f},{:.3f}\n",
                        upright ? "stump" : "log", piece.from.x(), piece.from.y(), piece.from.z(),
                        piece.to.x(), piece.to.y(), piece.to.z(), 2.0 * piece.radius_from_m,
                        2.0 * piece.radius_to_m);
  }
  return text;
}

std::string prism_text(const std::vector<PrismSample>& prism) {
  std::string text = "timestamp,x,y,z\n";
  for (const PrismSample& sample : prism) {
    text += fmt::format("{},{:.5f},{:.5f},{:.5f}\n", format_seconds(sample.stamp), sample.place.x(),
                        sample.place.y(), sample.place.z());
  }
  return text;
}

std::string head_text(const std::vector<HeadCutSample>& cuts) {
  std::string text = "timestamp,x,y,z\n";
  for (const HeadCutSample& cut : cuts) {
    const Eigen::Vector3d& p = cut.head_in_body;
    text +=
        fmt::format("{},{:.3f},{:.3f},{:.3f}\n", format_seconds(cut.stamp), p.x(), p.y(), p.z());
  }
  return text;
}

// Heights at the middle of cells of half a metre, in the truth's own frame (east, north; no
// coordinate system).
void write_terrain(const std::string& path, const Terrain& terrain) {
  constexpr double kCell = 0.5;
  const Eigen::Vector3d low = terrain.vertex(0, 0);
  const Eigen::Vector3d high = terrain.vertex(terrain.columns() - 1, terrain.rows() - 1);
  const int width = static_cast<int>((high.x() - low.x()) / kCell);
  const int height = static_cast<int>((high.y() - low.y()) / kCell);
  std::vector<float> cells;
  cells.reserve(static_cast<std::size_t>(width) * static_cast<std::size_t>(height));
  for (int row = 0; row < height; ++row) {
    for (int column = 0; column < width; ++column) {
      const double x = low.x() + kCell * (column + 0.5);
      const double y = high.y() - kCell * (row + 0.5);
      cells.push_back(static_cast<float>(terrain.height(x, y)));
    }
  }
  GDALAllRegister();
  GDALDriver* driver = GetGDALDriverManager()->GetDriverByName("GTiff");
  UNDERSTORY_CHECK(driver != nullptr);
  const char* options[] = {"COMPRESS=DEFLATE", "PREDICTOR=3", "TILED=YES", nullptr};
  GDALDataset* dataset =
      driver->Create(path.c_str(), width, height, 1, GDT_Float32, const_cast<char**>(options));
  if (dataset == nullptr) throw OutputError(path, "cannot be created");
  double transform[6] = {low.x(), kCell, 0.0, high.y(), 0.0, -kCell};
  dataset->SetGeoTransform(transform);
  const CPLErr written = dataset->GetRasterBand(1)->RasterIO(
      GF_Write, 0, 0, width, height, cells.data(), width, height, GDT_Float32, 0, 0);
  GDALClose(dataset);
  if (written != CE_None) throw OutputError(path, "cannot be written");
}

}  // namespace

void TruthLog::add(const ScanTruth& scan, const std::vector<StemReturns>& stems) {
  scans_.push_back(scan);
  for (const StemReturns& stem : stems) {
    if (blocks_.empty() || blocks_.back().stems.size() == kBlock) {
      if (!blocks_.empty()) put_away(blocks_.back());
      blocks_.emplace_back();
      blocks_.back().stems.reserve(kBlock);
    }
    blocks_.back().stems.push_back({stem.tree, static_cast<std::uint16_t>(stem.rings),
                                    static_cast<std::uint16_t>(stem.rings_with_3),
                                    static_cast<std::uint32_t>(stem.returns)});
  }
  stems_end_.push_back((stems_end_.empty() ? 0 : stems_end_.back()) + stems.size());
}

void TruthLog::put_away(Block& block) {
  try {
    if (!scratch_) {
      std::error_code none;
      const std::filesystem::path folder = std::filesystem::temp_directory_path(none);
      if (none) return;  // they stay in memory
      scratch_.emplace(folder);
    }
    block.part = scratch_->append(block.stems.data(), block.stems.size() * sizeof(Packed));
  } catch (const OutputError&) {
    return;
  }
  block.stems = std::vector<Packed>();  // `= {}` would keep its memory
}

std::size_t TruthLog::bytes_in_memory() const {
  std::size_t stems = read_stems_.capacity();
  for (const Block& block : blocks_)
    stems += block.stems.capacity();
  return stems * sizeof(Packed);
}

const std::vector<TruthLog::Packed>& TruthLog::read(std::size_t block) const {
  if (!blocks_[block].stems.empty()) return blocks_[block].stems;
  if (read_ != block || read_stems_.empty()) {
    read_stems_.resize(blocks_[block].part.size / sizeof(Packed));
    scratch_->read(blocks_[block].part, read_stems_.data());
    read_ = block;
  }
  return read_stems_;
}

std::vector<ScanTruth> TruthLog::poses() const {
  std::vector<ScanTruth> all;
  all.reserve(scans_.size() + further_.size());
  std::merge(scans_.begin(), scans_.end(), further_.begin(), further_.end(),
             std::back_inserter(all),
             [](const ScanTruth& a, const ScanTruth& b) { return a.stamp < b.stamp; });
  return all;
}

std::vector<StemReturns> TruthLog::stems(std::size_t i) const {
  std::vector<StemReturns> result;
  for (std::size_t k = i == 0 ? 0 : stems_end_[i - 1]; k < stems_end_[i]; ++k) {
    const Packed& stem = read(k / kBlock)[k % kBlock];
    result.push_back({stem.tree, stem.rings, stem.rings_with_3, static_cast<int>(stem.returns)});
  }
  return result;
}

bool is_truth_file(const std::string& name) {
  constexpr std::array<const char*, 13> kNames = {
      "trajectory.tum",  "velocity.csv", "imu_bias.csv",      "returns.csv.gz", "trees.csv",
      "stem_curves.csv", "dtm.tif",      "total_station.csv", "head.csv",       "site.yaml",
      "objects.csv",     "points.laz",   "dead_wood.csv"};
  return std::find(kNames.begin(), kNames.end(), name) != kNames.end();
}

void write_truth_folder(const std::string& folder, const SimulatedWorld& world, TimeNs start,
                        const TruthLog& log, const std::vector<PrismSample>& prism,
                        const std::vector<HeadCutSample>& cuts) {
  std::error_code error;
  std::filesystem::create_directories(folder, error);
  if (error) throw OutputError(folder, "cannot be made: " + error.message());
  const std::vector<ScanTruth> poses = log.poses();
  write_text(folder + "/trajectory.tum", trajectory_text(poses));
  write_text(folder + "/velocity.csv", velocity_text(poses));
  write_text(folder + "/imu_bias.csv", bias_text(log.scans()));
  write_returns(folder + "/returns.csv.gz", log);
  write_text(folder + "/trees.csv", trees_text(world, start, log));
  write_text(folder + "/stem_curves.csv", stem_curves_text(world.stand));
  if (!prism.empty()) write_text(folder + "/total_station.csv", prism_text(prism));
  if (!world.stand.objects.empty()) write_text(folder + "/objects.csv", objects_text(world.stand));
  if (!world.stand.dead_wood.empty())
    write_text(folder + "/dead_wood.csv", dead_wood_text(world.stand));
  if (!cuts.empty()) write_text(folder + "/head.csv", head_text(cuts));
  write_terrain(folder + "/dtm.tif", world.terrain);
  SiteConfig copy = world.site;
  ConfigTable table;
  describe_used(table, copy);
  write_text(folder + "/site.yaml", table.to_yaml(false));
}

}  // namespace understory
