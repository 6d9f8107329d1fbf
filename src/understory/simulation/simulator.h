#pragma once

#include <cstdint>
#include <functional>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "understory/recording/recording.h"
#include "understory/simulation/sensors/scanner.h"
#include "understory/simulation/site.h"

namespace understory {

// Which scans of a site with two lidars a simulator gives. Those of the first one are the same in
// all cases.
enum class SimulatedLidars { kFirst, kSecond, kBoth };

// A forest that is scanned while one reads. Events come in the order of their time (a scan's is its
// nominal end), made on request. The same site and seed give the same bytes, whatever the number of
// threads. Not thread-safe; casting a scan uses the current task arena.
class Simulator : public Recording {
 public:
  explicit Simulator(const SiteConfig& config);
  // Reads scans from a folder of casts where they are kept there, and keeps those that it casts
  // (ScanCache). The events are the same as without. What is kept is held against what the program
  // casts today, and forgotten with a warning ("simulation.cache") where it differs.
  Simulator(const SiteConfig& config, const std::string& cache_folder, Log& log);
  ~Simulator() override;

  // Before the first event; usual is the first one alone. The rig is that of the lidars that are
  // given, and each has a topic. The truth is noted at the scans of the first one, on the clock of
  // the carrier where there are two.
  void give(SimulatedLidars lidars);
  // Whether the scan that `next` gave last is that of the second lidar.
  [[nodiscard]] bool is_of_second_lidar() const;

  [[nodiscard]] std::optional<Event> next() override;
  // Skipped scans are not cast: cheap.
  void skip(std::uint64_t count) override;
  [[nodiscard]] const Rig& rig() const override;
  [[nodiscard]] std::vector<TopicReport> topics() const override;
  [[nodiscard]] std::string format() const override;
  [[nodiscard]] double progress() const override;

  // Where the second antenna gives positions (gnss.second_antenna_positions): that of the moment of
  // the fix that `next` gave last. That fix has the heading by both then, as recording/ finds it.
  [[nodiscard]] const std::optional<GnssFix>& second_fix() const;

  // From now on hands over the points of each scan that is cast, at their true places. Not
  // together with a folder of casts, which does not keep what gave an echo.
  void set_point_sink(std::function<void(const std::vector<TruePoint>&)> sink);

  [[nodiscard]] const SiteConfig& site() const;
  [[nodiscard]] double duration_s() const;

  // Writes the truth of what has been read so far into a folder, which is made if need be. Its
  // files are trajectory.tum, velocity.csv, imu_bias.csv (at every scan's stamp, skipped ones too),
  // trees.csv, dtm.tif and site.yaml. returns.csv.gz is of the scans that were cast,
  // total_station.csv is there where the site has one. Throws OutputError.
  void write_truth(const std::string& folder) const;

 private:
  class Impl;
  std::unique_ptr<Impl> impl_;
};

// Opens "sim:SITE?key=value&..." (SITE: a shipped site or a YAML file). The key `cache` names a
// folder for a ScanCache; without it the environment variable UNDERSTORY_SIMULATION_CACHE does,
// without both nothing is kept. Throws InputError for an unknown site, ConfigError for wrong keys.
// `lidar`: the topic of one of its lidars, "/lidar" or "/lidar_2"; empty: the first one.
[[nodiscard]] std::unique_ptr<Simulator> open_simulation(const std::string& uri, Log& log,
                                                         const std::string& lidar = "");

// The files that a site is read from: its own, if it is no shipped one, the list of its trees and
// their clouds. Throws as load_site does.
[[nodiscard]] std::vector<std::string> site_files(const std::string& name_or_path,
                                                  const std::vector<std::string>& settings);

}  // namespace understory
