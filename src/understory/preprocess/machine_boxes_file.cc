#include <yaml-cpp/yaml.h>

#include <algorithm>
#include <cmath>
#include <filesystem>
#include <fstream>

#include "understory/preprocess/machine_boxes.h"
#include "understory/util/angles.h"
#include "understory/util/error.h"
#include "understory/util/files/text_file.h"

namespace understory {
namespace {

// Reads one file and gathers what is wrong with it.
class BoxReader {
 public:
  explicit BoxReader(std::string path) : path_(std::move(path)) {}

  std::vector<MachineBox> read() {
    std::vector<MachineBox> boxes;
    try {
      boxes = read_boxes(load_yaml(read_text_file(path_), path_));
    } catch (const YAML::Exception& error) {
      problems_.push_back(path_ + ": line " + std::to_string(error.mark.line + 1) + ": " +
                          error.msg);
    }
    if (!problems_.empty()) throw ConfigError(problems_);
    return boxes;
  }

 private:
  std::vector<MachineBox> read_boxes(const YAML::Node& root) {
    std::vector<MachineBox> boxes;
    const bool one_key = root.IsMap() && root.size() == 1;
    if (!one_key || !root["boxes"] || !root["boxes"].IsSequence()) {
      problems_.push_back(path_ + ": expected one key `boxes` with a list");
      return boxes;
    }
    for (const YAML::Node& node : root["boxes"])
      boxes.push_back(read_box(node));
    return boxes;
  }

  void problem(const YAML::Node& node, const std::string& what) {
    problems_.push_back(path_ + ": line " + std::to_string(node.Mark().line + 1) + ": " + what);
  }

  void check_keys(const YAML::Node& node, const std::vector<std::string>& known) {
    for (const auto& entry : node) {
      const auto key = entry.first.as<std::string>("");
      if (std::find(known.begin(), known.end(), key) == known.end())
        problem(entry.first, "unknown key `" + key + "`");
    }
  }

  Eigen::Vector3d vector(const YAML::Node& node, const std::string& key,
                         const Eigen::Vector3d& otherwise) {
    const YAML::Node value = node[key];
    if (!value) return otherwise;
    const auto numbers = numbers_of(value, key, 3);
    return numbers.size() == 3 ? Eigen::Vector3d(numbers[0], numbers[1], numbers[2]) : otherwise;
  }

  std::vector<double> numbers_of(const YAML::Node& value, const std::string& key,
                                 std::size_t count) {
    std::vector<double> numbers;
    try {
      numbers = value.as<std::vector<double>>();
    } catch (const YAML::Exception&) {
      numbers.clear();
    }
    const bool finite =
        std::all_of(numbers.begin(), numbers.end(), [](double v) { return std::isfinite(v); });
    if (numbers.size() == count && finite) return numbers;
    problem(value, "`" + key + "` has to be " + std::to_string(count) + " numbers");
    return {};
  }

  MachineBox read_box(const YAML::Node& node) {
    MachineBox box;
    if (!node.IsMap()) {
      problem(node, "a box has to be a map of keys");
      return box;
    }
    check_keys(node, {"name", "frame", "center_m", "rotation_deg", "size_m", "joint"});
    box.name = node["name"].as<std::string>("");
    if (box.name.empty()) problem(node, "a box needs a `name`");
    const auto frame = node["frame"].as<std::string>("body");
    if (frame != "body" && frame != "lidar") problem(node["frame"], "`frame` is body or lidar");
    box.frame = frame == "lidar" ? MachineBox::Frame::kLidar : MachineBox::Frame::kBody;
    if (!node["center_m"] || !node["size_m"]) problem(node, "a box needs `center_m` and `size_m`");
    box.size_m = vector(node, "size_m", Eigen::Vector3d::Ones());
    if (!(box.size_m.minCoeff() > 0.0)) problem(node["size_m"], "`size_m` has to be above 0");
    const Eigen::Vector3d turn = kDegree * vector(node, "rotation_deg", Eigen::Vector3d::Zero());
    box.frame_from_box = Pose(Eigen::AngleAxisd(turn.z(), Eigen::Vector3d::UnitZ()) *
                                  Eigen::AngleAxisd(turn.y(), Eigen::Vector3d::UnitY()) *
                                  Eigen::AngleAxisd(turn.x(), Eigen::Vector3d::UnitX()),
                              vector(node, "center_m", Eigen::Vector3d::Zero()));
    if (node["joint"]) read_joint(node["joint"], box);
    return box;
  }

  void read_joint(const YAML::Node& node, MachineBox& box) {
    const auto type = node.IsMap() ? node["type"].as<std::string>("") : std::string();
    if (type != "revolute" && type != "prismatic") {
      problem(node, "a joint needs `type: revolute` or `type: prismatic`");
      return;
    }
    const bool turns = type == "revolute";
    const std::string unit = turns ? "deg" : "m";
    check_keys(node, {"type", "origin_m", "axis", "value_" + unit, "range_" + unit, "series"});
    box.joint = turns ? MachineBox::Joint::kRevolute : MachineBox::Joint::kPrismatic;
    box.joint_origin = vector(node, "origin_m", Eigen::Vector3d::Zero());
    const Eigen::Vector3d axis = vector(node, "axis", Eigen::Vector3d::UnitZ());
    if (!(axis.norm() > 0.0))
      problem(node["axis"], "`axis` has no direction");
    else
      box.joint_axis = axis.normalized();
    read_value(node, unit, turns ? kDegree : 1.0, box);
  }

  void read_value(const YAML::Node& node, const std::string& unit, double scale, MachineBox& box) {
    const YAML::Node value = node["value_" + unit];
    const YAML::Node range = node["range_" + unit];
    const YAML::Node series = node["series"];
    if (static_cast<bool>(value) + static_cast<bool>(range) + static_cast<bool>(series) != 1) {
      problem(node, "a joint needs one of `value_" + unit + "`, `range_" + unit + "`, `series`");
    } else if (value) {
      try {
        box.constant = scale * value.as<double>();
      } catch (const YAML::Exception&) {
        problem(value, "`value_" + unit + "` has to be a number");
      }
    } else if (range) {
      const std::vector<double> limits = numbers_of(range, "range_" + unit, 2);
      if (limits.size() != 2) return;
      if (limits[0] > limits[1]) problem(range, "the range has to be low, high");
      box.value = MachineBox::Value::kSwept;
      box.low = scale * limits[0];
      box.high = scale * limits[1];
    } else {
      box.value = MachineBox::Value::kSeries;
      const auto beside = std::filesystem::path(path_).parent_path();
      box.series = read_series((beside / series.as<std::string>("")).string(), scale);
    }
  }

  static std::vector<MachineBox::Sample> read_series(const std::string& path, double scale) {
    std::error_code error;  // a device has no end
    std::ifstream file;
    if (std::filesystem::is_regular_file(path, error)) file.open(path);
    std::string line;
    if (!file.is_open() || !read_line(file, line, path, 1))
      throw InputError(path, "", "cannot be read; expected a CSV file `timestamp,value`");
    if (!line.empty() && line.back() == '\r') line.pop_back();
    if (line != "timestamp,value")
      throw InputError(path, "line 1", "expected the header `timestamp,value`");
    std::vector<MachineBox::Sample> series;
    for (std::uint64_t number = 2; read_line(file, line, path, number); ++number) {
      if (!line.empty() && line.back() == '\r') line.pop_back();
      if (line.empty()) continue;
      const std::string at = "line " + std::to_string(number);
      const std::size_t comma = line.find(',');
      MachineBox::Sample sample;
      char* end = nullptr;
      const std::string value = comma == std::string::npos ? "" : line.substr(comma + 1);
      sample.value = scale * std::strtod(value.c_str(), &end);
      const bool number_read = !value.empty() && *end == '\0' && std::isfinite(sample.value);
      if (!number_read || !parse_seconds(line.substr(0, comma), sample.stamp))
        throw InputError(path, at, "expected `timestamp,value` in seconds and degrees or metres");
      if (!series.empty() && sample.stamp <= series.back().stamp)
        throw InputError(path, at, "expected growing timestamps");
      series.push_back(sample);
    }
    if (series.empty()) throw InputError(path, "", "holds no values");
    return series;
  }

  std::string path_;
  std::vector<std::string> problems_;
};

}  // namespace

std::vector<MachineBox> read_machine_boxes(const std::string& path) {
  return BoxReader(path).read();
}

}  // namespace understory
