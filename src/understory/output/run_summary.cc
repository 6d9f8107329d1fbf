#include "understory/output/run_summary.h"

#include <yaml-cpp/yaml.h>

#include <cmath>
#include <nlohmann/json.hpp>
#include <numeric>

#include "understory/util/files/atomic_file.h"

namespace understory {
namespace {

using Json = nlohmann::ordered_json;

// Rounded to microseconds or the like: the tail of a double tells nothing and makes files differ.
Json number(double value) {
  if (!std::isfinite(value)) return nullptr;
  return std::round(value * 1e6) / 1e6;
}

Json to_json(const Distribution& values) {
  return {{"mean", number(values.mean)},
          {"p50", number(values.p50)},
          {"p99", number(values.p99)},
          {"max", number(values.max)}};
}

Json to_json(const std::map<std::string, Figure>& figures) {
  Json result = Json::object();
  for (const auto& [name, figure] : figures) {
    if (const double* value = std::get_if<double>(&figure)) {
      result[name] = std::isfinite(*value) ? Json(*value) : Json(nullptr);
    } else {
      std::visit([&, key = name](const auto& other) { result[key] = other; }, figure);
    }
  }
  return result;
}

Json scalar_to_json(const YAML::Node& node) {
  if (node.Tag() == "!") return node.as<std::string>();  // quoted
  std::int64_t integer = 0;
  if (YAML::convert<std::int64_t>::decode(node, integer)) return integer;
  double real = 0.0;
  if (YAML::convert<double>::decode(node, real)) {
    return std::isfinite(real) ? Json(real) : Json(node.Scalar());
  }
  bool truth = false;
  if (YAML::convert<bool>::decode(node, truth)) return truth;
  return node.Scalar();
}

Json to_json(const YAML::Node& node) {
  if (node.IsMap()) {
    Json result = Json::object();
    for (const auto& entry : node)
      result[entry.first.as<std::string>()] = to_json(entry.second);
    return result;
  }
  if (node.IsSequence()) {
    Json result = Json::array();
    for (const auto& entry : node)
      result.push_back(to_json(entry));
    return result;
  }
  return node.IsScalar() ? scalar_to_json(node) : Json(nullptr);
}

Json numbers(const std::vector<double>& values) {
  Json list = Json::array();
  for (const double value : values)
    list.push_back(number(value));
  return list;
}

Json or_null(double value) {
  return std::isfinite(value) ? Json(value) : Json(nullptr);
}

Json or_null(const std::string& text) {
  return text.empty() ? Json(nullptr) : Json(text);
}

Json to_json(const ImuCalibrationFigures& figures) {
  Json rows = Json::array();
  for (std::size_t row = 0; row < 7; ++row) {
    const auto first = figures.covariance.begin() + static_cast<std::ptrdiff_t>(7 * row);
    rows.push_back(std::vector<double>(first, first + 7));
  }
  return {{"body_from_imu",
           {{"translation_m", figures.translation_m}, {"rotation_xyzw", figures.rotation_xyzw}}},
          {"imu_late_s", figures.late_s},
          {"order", {"rx_rad", "ry_rad", "rz_rad", "x_m", "y_m", "z_m", "late_s"}},
          {"covariance", rows},
          {"duration_s", figures.duration_s},
          {"windows", figures.windows},
          {"begun_anew", figures.begun_anew},
          {"used_imu_late_s", figures.used_late_s},
          {"used_moved_m", figures.moved_m},
          {"used_turned_deg", figures.turned_deg}};
}

// All digits: whoever reads it brings layers back to the world frame by it.
Json to_json(const RunPlace& place) {
  Json json;
  json["on_globe"] = place.on_globe;
  json["reason"] = or_null(place.reason);
  if (place.antenna_in_body) {
    const Eigen::Vector3d& at = *place.antenna_in_body;
    json["antenna_in_body_m"] = {at.x(), at.y(), at.z()};
  }
  if (place.second_antenna_in_body) {
    const Eigen::Vector3d& at = *place.second_antenna_in_body;
    json["second_antenna_in_body_m"] = {at.x(), at.y(), at.z()};
  }
  if (!place.on_globe) return json;
  const Eigen::Vector3d& t = place.enu_from_world.translation();
  const Eigen::Quaterniond& q = place.enu_from_world.rotation();
  json["method"] = or_null(place.method);
  json["coordinate_system"] = or_null(place.coordinate_system);
  json["heights"] = or_null(place.heights);
  json["origin"] = {{"latitude_deg", place.origin.latitude_deg},
                    {"longitude_deg", place.origin.longitude_deg},
                    {"height_m", place.origin.height_m}};
  json["enu_from_world"] = {{"translation_m", {t.x(), t.y(), t.z()}},
                            {"rotation_xyzw", {q.x(), q.y(), q.z(), q.w()}}};
  json["true_north_deg"] = place.north_deg;
  json["grid_scale"] = place.grid_scale;
  json["expected_error_m"] = or_null(place.expected_error_m);
  json["heading_sd_deg"] = or_null(place.heading_sd_deg);
  return json;
}

Json to_json(const std::vector<ScanBlock>& blocks) {
  Json json;
  for (const ScanBlock& block : blocks) {
    json["from_s"].push_back(number(block.from_s));
    json["scans"].push_back(block.scans);
    json["wall_ms"].push_back(number(block.wall_ms));
    json["cpu_ms"].push_back(number(block.cpu_ms));
    json["map_size"].push_back(number(block.map_size));
  }
  return json;
}

Json to_json(const std::map<std::string, StageSummary>& stages) {
  Json json = Json::object();
  for (const auto& [name, stage] : stages) {
    json[name] = {{"wall_ms", to_json(stage.wall_ms)},
                  {"cpu_ms", to_json(stage.cpu_ms)},
                  {"runs", stage.wall_ms.count},
                  {"total_wall_s", number(stage.total_wall_s)}};
    if (!stage.cpu_ms_by_tenth.empty())
      json[name]["cpu_ms_by_tenth"] = numbers(stage.cpu_ms_by_tenth);
  }
  return json;
}

std::vector<double> means_by_tenth(const std::vector<double>& values) {
  const std::size_t share = values.size() / 10;
  if (share < 10) return {};
  std::vector<double> means;
  for (std::size_t k = 0; k < 10; ++k) {
    const auto first = values.begin() + static_cast<std::ptrdiff_t>(k * share);
    means.push_back(std::accumulate(first, first + static_cast<std::ptrdiff_t>(share), 0.0) /
                    static_cast<double>(share));
  }
  return means;
}

}  // namespace

std::string to_string(RunStatus status) {
  switch (status) {
    case RunStatus::kComplete:
      return "complete";
    case RunStatus::kPartial:
      return "partial";
    case RunStatus::kUntrusted:
      break;
  }
  return "untrusted";
}

std::map<std::string, StageSummary> summarise(const StageTimes& times) {
  std::map<std::string, StageSummary> result;
  for (const std::string& stage : times.stages()) {
    std::vector<double> wall;
    std::vector<double> cpu;
    for (const StageTimes::Sample& sample : times.samples(stage)) {
      wall.push_back(static_cast<double>(sample.wall_ms));
      cpu.push_back(static_cast<double>(sample.cpu_ms));
    }
    std::vector<double> tenths = means_by_tenth(cpu);
    result[stage] = {distribution_of(std::move(wall)), distribution_of(std::move(cpu)),
                     times.total_wall_ms(stage) * 1e-3, std::move(tenths)};
  }
  return result;
}

std::vector<ScanBlock> joined(const std::vector<ScanBlock>& blocks, std::size_t most) {
  std::vector<ScanBlock> result;
  const std::size_t together = most == 0 ? blocks.size() : (blocks.size() + most - 1) / most;
  for (std::size_t i = 0; i < blocks.size(); ++i) {
    const ScanBlock& block = blocks[i];
    if (i % together == 0) result.emplace_back().from_s = block.from_s;
    ScanBlock& into = result.back();
    into.scans += block.scans;
    const double share = static_cast<double>(block.scans) / static_cast<double>(into.scans);
    into.wall_ms += share * (block.wall_ms - into.wall_ms);
    into.cpu_ms += share * (block.cpu_ms - into.cpu_ms);
    into.map_size += share * (block.map_size - into.map_size);
  }
  return result;
}

void add_latency(const Distribution& latency_ms, RunSummary& summary) {
  summary.quality["latency_ms_mean"] = latency_ms.mean;
  summary.quality["latency_ms_p50"] = latency_ms.p50;
  summary.quality["latency_ms_p99"] = latency_ms.p99;
  summary.quality["latency_ms_max"] = latency_ms.max;
}

std::string run_json(const RunSummary& summary) {
  Json json;
  json["status"] = to_string(summary.status);
  json["reasons"] = summary.reasons;
  json["notes"] = summary.notes;
  json["warnings"] = Json::array();
  for (const Log::Warning& warning : summary.warnings) {
    json["warnings"].push_back(
        {{"key", warning.key}, {"message", warning.first_message}, {"count", warning.count}});
  }
  json["command"] = summary.command;
  json["version"] = summary.version;
  json["format"] = kRunFormat;
  json["scans"] = summary.scans;
  json["poses"] = summary.poses;
  json["recording_s"] = number(summary.recording_s);
  json["wall_s"] = number(summary.wall_s);
  json["cpu_s"] = number(summary.cpu_s);
  json["peak_memory_mb"] = number(summary.peak_memory_mb);
  json["stages"] = to_json(summary.stages);
  if (!summary.scan_blocks.empty()) json["scan_blocks"] = to_json(summary.scan_blocks);
  json["counts"] = to_json(summary.counts);
  json["quality"] = to_json(summary.quality);
  if (!summary.evidence.empty()) json["evidence"] = to_json(summary.evidence);
  if (!summary.lidar_view.highest_deg.empty()) {
    json["lidar_view"] = {{"body_from_lidar", numbers(summary.lidar_view.body_from_lidar)},
                          {"highest_deg", numbers(summary.lidar_view.highest_deg)}};
  }
  if (summary.imu_calibration) json["imu_calibration"] = to_json(*summary.imu_calibration);
  if (!summary.lidar_model.empty()) json["lidar_model"] = summary.lidar_model;
  json["coordinate_system"] = summary.crs_wkt.empty() ? Json(nullptr) : Json(summary.crs_wkt);
  if (summary.place) json["georeference"] = to_json(*summary.place);
  if (!summary.frames.empty()) json["frames"] = summary.frames;
  json["inputs"] = Json::array();
  for (const InputHash& input : summary.inputs) {
    json["inputs"].push_back(
        {{"file", input.file},
         {"bytes", input.bytes},
         {"sha256", input.sha256.empty() ? Json(nullptr) : Json(input.sha256)}});
  }
  json["config"] = to_json(YAML::Load(summary.config.asked_yaml));
  json["config_origins"] = summary.config.origins;
  const bool as_asked = summary.config.effective_yaml.empty();
  json["effective_config"] =
      as_asked ? json["config"] : to_json(YAML::Load(summary.config.effective_yaml));
  json["adapted"] = Json::array();
  for (const ConfigAdaptation& change : summary.config.adapted) {
    json["adapted"].push_back({{"key", change.key},
                               {"from", to_json(YAML::Load(change.from))},
                               {"to", to_json(YAML::Load(change.to))},
                               {"when_s", number(change.when_s)},
                               {"why", change.why}});
  }
  return json.dump(2, ' ', false, Json::error_handler_t::replace) + "\n";
}

void write_run_json(const std::filesystem::path& path, const RunSummary& summary) {
  AtomicFile file(path);
  file.write(run_json(summary));
  file.commit();
}

}  // namespace understory
