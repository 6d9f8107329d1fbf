#include "understory/simulation/simulator.h"
#include "understory/simulation/simulation_uri.h"

#include <algorithm>
#include <cmath>
#include <cstdlib>
#include <cstring>
#include <limits>
#include <utility>

#include "understory/recording/messages/baseline_headings.h"
#include "understory/simulation/scene/scan_cache.h"
#include "understory/simulation/sensors/inertial.h"
#include "understory/simulation/sensors/magnetometer.h"
#include "understory/simulation/sensors/satellite.h"
#include "understory/simulation/sensors/scanner.h"
#include "understory/simulation/sensors/total_station.h"
#include "understory/simulation/stand/stand.h"
#include "understory/simulation/truth.h"
#include "understory/simulation/world.h"
#include "understory/util/error.h"

namespace understory {
namespace {

bool same_readings(const ScanReadings& a, const ScanReadings& b) {
  if (a.beams.size() != b.beams.size() || a.stems.size() != b.stems.size()) return false;
  return std::memcmp(a.beams.data(), b.beams.data(), a.beams.size() * sizeof(a.beams[0])) == 0 &&
         std::memcmp(a.stems.data(), b.stems.data(), a.stems.size() * sizeof(a.stems[0])) == 0;
}

void note(TopicReport& report, TimeNs stamp) {
  if (report.messages == 0) report.first_stamp = stamp;
  if (report.messages > 0) {
    report.longest_gap = std::max(report.longest_gap, stamp - report.last_stamp);
  }
  report.last_stamp = stamp;
  ++report.messages;
}

}  // namespace

namespace {

// The site as its second lidar is made from it. Its errors are others than those of the first one.
SiteConfig site_of_second(const SiteConfig& site) {
  constexpr int kOtherErrors = 0x2a5c96;
  SiteConfig second = site;
  second.seed ^= kOtherErrors;
  const SecondLidarConfig& lidar = site.second_lidar;
  second.lidar.mount_m = lidar.mount_m;
  second.lidar.mount_rpy_deg = lidar.mount_rpy_deg;
  second.lidar.rate_hz = lidar.rate_hz;
  second.lidar.fov_deg = lidar.fov_deg;
  second.lidar.time_offset_s = lidar.time_offset_s;
  return second;
}

TopicReport lidar_report(const std::string& frame, const std::string& model) {
  TopicReport report;
  report.name = "/" + frame;
  report.type = "simulated " + model;
  report.frame = frame;
  report.role = "lidar";
  report.conventions = "t: ns since stamp; stamp = first firing";
  return report;
}

}  // namespace

class Simulator::Impl : public SimulatedWorld {
 public:
  explicit Impl(const SiteConfig& config)
      : SimulatedWorld(config),
        start(from_start(config.origin.start_time_s)),
        scanner(config, scene, plan.path, machine, start),
        imu(config, plan.path, start, plan.shocks_s),
        gnss(config, plan.path, scene, start),
        mag(config, plan.path, start) {
    duration_s = config.duration_s > 0.0 ? config.duration_s : plan.path.duration_s() - 0.5;
    end = start + from_seconds(duration_s);
    if (config.second_lidar.enabled)
      second.emplace(site_of_second(config), scene, plan.path, machine, start);
    describe_rig();
    describe_topics();
    if (rig.body_from_second_gnss) {
      antennas.set_length_m(
          (rig.body_from_second_gnss->translation() - rig.body_from_gnss->translation()).norm());
    }
    next_fix = find_fix();
  }

  // The next event; a scan is cast only if `wanted`. Returns false at the end.
  bool advance(bool wanted, std::optional<Event>& event) {
    while (site.imu.enabled && imu.next_stamp() < end && imu.lost()) {
      note_biases(imu.next_stamp());
      imu.skip();
    }
    constexpr TimeNs kNever = std::numeric_limits<TimeNs>::max();
    const TimeNs imu_time = site.imu.enabled ? imu.next_stamp() : kNever;
    const TimeNs mag_time = site.mag.enabled ? mag.next_stamp() : kNever;
    const TimeNs fix_time = next_fix ? next_fix->stamp + from_seconds(site.gnss.latency_s) : kNever;
    const bool scans = site.scans && lidars != SimulatedLidars::kSecond;
    const TimeNs scan_time = scans ? scanner.end(number_of(scan_number)) : kNever;
    const TimeNs second_time = next_of_second();
    const TimeNs first = std::min({imu_time, mag_time, fix_time, scan_time, second_time});
    if (first >= end) return false;
    if (imu_time == first) {
      take_imu(wanted, event);
    } else if (mag_time == first) {
      note(reports[3], mag_time);
      const MagSample sample = mag.next();
      if (wanted) event = sample;
    } else if (fix_time == first) {
      note(reports[2], next_fix->stamp);
      if (wanted) event = *next_fix;
      second_fix = next_second_fix;
      next_fix = find_fix();
    } else if (scan_time == first) {
      of_second = false;
      take_scan(wanted, event);
    } else {
      of_second = true;
      take_second_scan(wanted, event);
    }
    now = first;
    return true;
  }

  void use_cache(const std::string& folder, Log& log) {
    if (!ScanCache::fits(site.lidar)) {
      log.warn("simulation.cache", "ranges are too fine or too long to be kept");
      return;
    }
    cache = std::make_unique<ScanCache>(folder, site_key(site), site.lidar.range_step_m);
    if (cache->is_foreign())
      log.warn("simulation.cache", cache->path() +
                                       ": is no file of this program, and stays as it "
                                       "is: scans are cast and not kept");
    const auto span = cache->span();
    if (!span) return;
    for (const std::int64_t scan : {span->first, span->second}) {
      const std::optional<ScanReadings> kept = cache->find(scan);
      if (kept && same_readings(*kept, scanner.measure(scan))) continue;
      log.warn("simulation.cache", cache->path() + ": made by another version, begun anew");
      cache->clear();
      return;
    }
  }

  const TimeNs start;
  double duration_s = 0.0;
  TimeNs end = 0;
  Scanner scanner;
  InertialSensor imu;
  SatelliteReceiver gnss;
  Magnetometer mag;
  std::optional<GnssFix> next_fix;
  std::optional<GnssFix> next_second_fix;
  std::optional<GnssFix> second_fix;  // of the last event that is a fix
  BaselineHeadings antennas;
  std::optional<Scanner> second;  // lidar
  SimulatedLidars lidars = SimulatedLidars::kFirst;
  std::int64_t scan_number = 0;
  std::int64_t second_number = 0;
  bool of_second = false;  // the last scan is
  TimeNs now = 0;
  Rig rig;
  std::vector<TopicReport> reports;
  TruthLog truths;
  std::unique_ptr<ScanCache> cache;
  std::function<void(const std::vector<TruePoint>&)> point_sink;
  // Biases at the stamps of scans that are not finished yet.
  std::vector<std::pair<Eigen::Vector3d, Eigen::Vector3d>> biases;

  void describe_rig() {
    const Pose error = mount_pose(site.lidar.error_m, site.lidar.error_rpy_deg);
    const Pose body_from_first = scanner.body_from_lidar() * error;
    const bool second_alone = second && lidars == SimulatedLidars::kSecond;
    rig.body_frame = site.carrier.body;
    rig.body_from_lidar = second_alone ? second->body_from_lidar() : body_from_first;
    rig.further_lidars.clear();
    if (second && lidars == SimulatedLidars::kBoth)
      rig.further_lidars.push_back({body_from_first.inverse() * second->body_from_lidar(), 0});
    describe_other_places();
  }

 private:
  static TimeNs from_start(double start_time_s) {
    const double whole = std::floor(start_time_s);
    return static_cast<TimeNs>(whole) * kNsPerSecond + from_seconds(start_time_s - whole);
  }

  // The revolution that is recorded as the scan of that place in the recording.
  [[nodiscard]] std::int64_t number_of(std::int64_t scan) const {
    return scan * site.lidar.keep_every;
  }

  // When the next scan of the second lidar is complete; never once it is dead.
  TimeNs next_of_second() {
    constexpr TimeNs kNever = std::numeric_limits<TimeNs>::max();
    if (!second || !site.scans || lidars == SimulatedLidars::kFirst) return kNever;
    const SecondLidarConfig& lidar = site.second_lidar;
    while (second->stamp(second_number) < start + from_seconds(lidar.begins_s))
      ++second_number;
    const TimeNs complete = second->end(second_number);
    const bool dead = lidar.ends_s > 0.0 && complete > start + from_seconds(lidar.ends_s);
    return dead ? kNever : complete;
  }

  void take_second_scan(bool wanted, std::optional<Event>& event) {
    ScanTruth truth;
    truth.stamp = second->stamp(second_number);
    const CarrierState state = plan.path.state(to_seconds(truth.stamp - start));
    truth.world_from_body = state.world_from_body;
    truth.velocity = state.velocity;
    truths.add_pose(truth);
    TopicReport& report = reports.back();
    note(report, second->stamp(second_number) + from_seconds(site.second_lidar.time_offset_s));
    if (wanted) {
      ScanPtr scan = second->assemble(second_number, second->measure(second_number));
      report.points += scan->points.size();
      event = std::move(scan);
    }
    ++second_number;
  }

  // Keeps the biases of the scans that began before a sample.
  void note_biases(TimeNs stamp) {
    if (!site.scans) return;
    while (scanner.stamp(number_of(static_cast<std::int64_t>(biases.size()))) <= stamp)
      biases.emplace_back(imu.gyro_bias(), imu.accel_bias());
  }

  void take_imu(bool wanted, std::optional<Event>& event) {
    const TimeNs stamp = imu.next_stamp();
    note_biases(stamp);
    note(reports[1], stamp);
    if (wanted) {
      event = imu.next();
    } else {
      imu.skip();
    }
  }

  void take_scan(bool wanted, std::optional<Event>& event) {
    ScanTruth truth;
    std::vector<StemReturns> stems;
    const std::int64_t number = number_of(scan_number);
    truth.stamp = scanner.stamp(number);
    const CarrierState state = plan.path.state(to_seconds(truth.stamp - start));
    const TimeNs on_carrier = truth.stamp;
    truth.stamp += from_seconds(site.lidar.time_offset_s);
    truth.world_from_body = state.world_from_body;
    truth.velocity = state.velocity;
    if (!biases.empty()) {
      const std::size_t at = std::min(static_cast<std::size_t>(scan_number), biases.size() - 1);
      truth.gyro_bias = biases[at].first;
      truth.accel_bias = biases[at].second;
    }
    note(reports[0], truth.stamp);
    if (second) truth.stamp = on_carrier;
    if (wanted) {
      ScanReadings readings = measure(number);
      ScanPtr scan = scanner.assemble(number, readings);
      reports[0].points += scan->points.size();
      if (point_sink) point_sink(scanner.true_points(*scan, readings));
      stems = std::move(readings.stems);
      event = std::move(scan);
    }
    truths.add(truth, stems);
    ++scan_number;
  }

  ScanReadings measure(std::int64_t scan) {
    if (!cache) return scanner.measure(scan);
    if (std::optional<ScanReadings> kept = cache->find(scan)) return std::move(*kept);
    ScanReadings readings = scanner.measure(scan);
    cache->store(scan, readings);
    return readings;
  }

  std::optional<GnssFix> find_fix() {
    while (site.gnss.enabled && gnss.next_stamp() < end) {
      std::optional<GnssFix> fix = gnss.next();
      if (!fix) continue;
      next_second_fix = gnss.second_fix();
      if (!next_second_fix) return fix;
      if (const auto line = antennas.add(*fix, *next_second_fix)) {
        fix->heading_deg = line->heading_deg;
        fix->heading_sd_deg = line->sd_deg;
      }
      return fix;
    }
    return std::nullopt;
  }

  void describe_other_places() {
    if (site.imu.enabled) rig.body_from_imu = imu.body_from_imu();
    rig.body_from_gnss =
        Pose(Eigen::Quaterniond::Identity(),
             Eigen::Vector3d(site.gnss.mount_m[0], site.gnss.mount_m[1], site.gnss.mount_m[2]));
    const Eigen::Vector3d line(site.gnss.second_antenna_m[0], site.gnss.second_antenna_m[1],
                               site.gnss.second_antenna_m[2]);
    if (!line.isZero()) {
      rig.body_from_second_gnss =
          Pose(Eigen::Quaterniond::Identity(), rig.body_from_gnss->translation() + line);
      rig.second_gnss_extrinsic_source = "simulation";
    }
    if (site.scans) rig.lidar_model = site.lidar.model;
    if (rig.lidar_model.rfind("OS", 0) == 0) rig.lidar_model.insert(2, "-");
    // Its beams have no width, unlike those of the lidar of this name.
    if (site.scans && site.lidar.rays_per_beam == 1) rig.lidar_model += ", single rays";
    rig.lidar_extrinsic_source = "simulation";
    if (site.imu.enabled) rig.imu_extrinsic_source = "simulation";
    rig.gnss_extrinsic_source = "simulation";
  }

  void describe_topics() {
    reports.resize(4);
    reports[0] = lidar_report("lidar", site.lidar.model);
    reports[1].name = "/imu";
    reports[1].type = "simulated IMU";
    reports[1].frame = "imu";
    reports[1].role = "imu";
    reports[1].conventions = "rad/s, m/s^2, specific force";
    reports[2].name = "/gnss";
    reports[2].type = "simulated GNSS";
    reports[2].frame = "gnss";
    reports[2].role = "gnss";
    reports[2].conventions = "WGS 84, ellipsoidal height";
    reports[3].name = "/mag";
    reports[3].type = "simulated magnetometer";
    reports[3].frame = "imu";
    reports[3].role = "mag";
    reports[3].conventions = "tesla";
    if (second) reports.push_back(lidar_report("lidar_2", site.lidar.model));
  }
};

Simulator::Simulator(const SiteConfig& config) : impl_(std::make_unique<Impl>(config)) {}
Simulator::Simulator(const SiteConfig& config, const std::string& cache_folder, Log& log)
    : Simulator(config) {
  impl_->use_cache(cache_folder, log);
}
Simulator::~Simulator() = default;

void Simulator::give(SimulatedLidars lidars) {
  UNDERSTORY_CHECK(impl_->now == 0 && (lidars == SimulatedLidars::kFirst || impl_->second));
  impl_->lidars = lidars;
  impl_->describe_rig();
}

bool Simulator::is_of_second_lidar() const {
  return impl_->of_second;
}

std::optional<Event> Simulator::next() {
  std::optional<Event> event;
  impl_->advance(true, event);
  return event;
}

void Simulator::skip(std::uint64_t count) {
  std::optional<Event> nothing;
  for (std::uint64_t i = 0; i < count; ++i) {
    if (!impl_->advance(false, nothing)) return;
  }
}

const Rig& Simulator::rig() const {
  return impl_->rig;
}

std::vector<TopicReport> Simulator::topics() const {
  const SiteConfig& site = impl_->site;
  const SimulatedLidars lidars = impl_->lidars;
  const bool present[] = {site.scans && lidars != SimulatedLidars::kSecond, site.imu.enabled,
                          site.gnss.enabled, site.mag.enabled,
                          site.scans && lidars != SimulatedLidars::kFirst};
  std::vector<TopicReport> reports;
  for (std::size_t i = 0; i < impl_->reports.size(); ++i) {
    if (present[i]) reports.push_back(impl_->reports[i]);
  }
  return reports;
}

std::string Simulator::format() const {
  const std::string lidar = impl_->site.scans ? impl_->site.lidar.model : "no lidar";
  return "simulation (" + lidar + ", seed " + std::to_string(impl_->site.seed) + ")";
}

double Simulator::progress() const {
  if (impl_->now == 0) return 0.0;
  return std::clamp(to_seconds(impl_->now - impl_->start) / impl_->duration_s, 0.0, 1.0);
}

const std::optional<GnssFix>& Simulator::second_fix() const {
  return impl_->second_fix;
}

void Simulator::set_point_sink(std::function<void(const std::vector<TruePoint>&)> sink) {
  UNDERSTORY_CHECK(!impl_->cache);
  impl_->scanner.keep_sources();
  impl_->point_sink = std::move(sink);
}

const SiteConfig& Simulator::site() const {
  return impl_->site;
}

double Simulator::duration_s() const {
  return impl_->duration_s;
}

void Simulator::write_truth(const std::string& folder) const {
  // As far as scans were read; casting brings the scene to its own moments anyway.
  const std::vector<ScanTruth>& scans = impl_->truths.scans();
  const double until_s = scans.empty() ? 0.0 : to_seconds(scans.back().stamp - impl_->start);
  write_truth_folder(folder, *impl_, impl_->start, impl_->truths,
                     track_prism(*impl_, impl_->start, until_s),
                     log_head_cuts(*impl_, impl_->start, until_s));
}

std::unique_ptr<Simulator> open_simulation(const std::string& uri, Log& log,
                                           const std::string& lidar) {
  const SimulationUri parts = parse_simulation_uri(uri);
  std::string folder;
  if (const char* named = std::getenv("UNDERSTORY_SIMULATION_CACHE")) folder = named;
  std::vector<std::string> settings;
  for (const std::string& setting : parts.settings) {
    if (setting.rfind("cache=", 0) == 0) {
      folder = setting.substr(6);
    } else {
      settings.push_back(setting);
    }
  }
  const SiteConfig site = with_problems_of(parts, [&] { return load_site(parts.site, settings); });
  if (site.truth.points) {
    throw ConfigError(
        {"truth.points: only `understory simulate` writes points.laz; simulate a "
         "recording and map that"});
  }
  log.debug("simulating " + parts.site);
  if (!lidar.empty() && lidar != "/lidar" && !(lidar == "/lidar_2" && site.second_lidar.enabled))
    throw InputError(uri, "", "has no lidar " + lidar);
  auto simulator = folder.empty() ? std::make_unique<Simulator>(site)
                                  : std::make_unique<Simulator>(site, folder, log);
  if (lidar == "/lidar_2") simulator->give(SimulatedLidars::kSecond);
  return simulator;
}

std::vector<std::string> site_files(const std::string& name_or_path,
                                    const std::vector<std::string>& settings) {
  const std::string trees = load_site(name_or_path, settings).stand.trees;
  std::vector<std::string> files;
  if (!trees.empty()) files = tree_cloud_files(trees);
  files.push_back(trees);
  if (!is_shipped_site(name_or_path)) files.push_back(name_or_path);
  return files;
}

}  // namespace understory
