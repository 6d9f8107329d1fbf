#include "understory/recording/extrinsics.h"

#include <yaml-cpp/yaml.h>

#include <algorithm>
#include <cmath>
#include <deque>
#include <numbers>
#include <optional>
#include <vector>

#include "understory/geometry/pose_io.h"
#include "understory/util/error.h"
#include "understory/util/files/text_file.h"

namespace understory {
namespace {

constexpr const char* kBaseFrame = "base_link";

class ExtrinsicsFile {
 public:
  explicit ExtrinsicsFile(const std::string& path) : path_(path) {}

  // What the file says.
  struct Given {
    std::optional<std::string> body_frame;
    std::optional<std::string> lidar_model;
    std::optional<Pose> body_from_lidar;
    std::optional<double> late_s;  // of the only lidar
    std::optional<Pose> body_from_imu;
    std::optional<Pose> body_from_gnss;
    std::optional<Pose> body_from_second_gnss;
    struct Lidar {
      ListedLidar listed;
      std::optional<std::string> model;
      std::optional<Pose> body_from_lidar;
    };
    std::vector<Lidar> lidars;

    // Of a list, the places are those of one entry.
    void use_entry(int entry) {
      const auto index = static_cast<std::size_t>(entry);
      if (index >= lidars.size()) return;
      body_from_lidar = lidars[index].body_from_lidar;
      if (lidars[index].model) lidar_model = lidars[index].model;
    }
  };

  Given read(const YAML::Node& root) {
    Given given;
    if (!root.IsMap()) {
      problem("", "expected keys such as body_from_lidar");
      return given;
    }
    for (const auto& entry : root) {
      const auto key = entry.first.as<std::string>("");
      const YAML::Node& value = entry.second;
      if (key == "body_frame") {
        given.body_frame = value.as<std::string>("");
      } else if (key == "lidar_model") {
        given.lidar_model = value.as<std::string>("");
      } else if (key == "body_from_lidar") {
        given.body_from_lidar = read_pose(value, key);
      } else if (key == "body_from_imu") {
        given.body_from_imu = read_pose(value, key);
      } else if (key == "body_from_gnss") {
        given.body_from_gnss = read_pose(value, key);
      } else if (key == "body_from_second_gnss") {
        given.body_from_second_gnss = read_pose(value, key);
      } else if (key == "late_s") {
        given.late_s = read_lateness(value, key);
      } else if (key == "lidars") {
        read_lidars(value, given);
      } else {
        problem(key,
                "unknown key; expected body_frame, lidar_model, body_from_lidar, late_s, lidars, "
                "body_from_imu, body_from_gnss or body_from_second_gnss");
      }
    }
    if (!given.lidars.empty() && (given.body_from_lidar || given.lidar_model || given.late_s))
      problem("lidars", "expected no body_from_lidar, lidar_model or late_s beside the list");
    return given;
  }

  void throw_problems() const {
    if (!problems_.empty()) throw ConfigError(problems_);
  }

 private:
  void read_lidars(const YAML::Node& node, Given& given) {
    if (!node.IsSequence() || node.size() == 0) {
      problem("lidars", "expected a list of lidars, each with its topic");
      return;
    }
    for (const YAML::Node& entry : node) {
      Given::Lidar lidar = read_lidar(entry, "lidars[" + std::to_string(given.lidars.size()) + "]");
      const std::string& topic = lidar.listed.topic;
      for (const Given::Lidar& other : given.lidars) {
        if (!topic.empty() && other.listed.topic == topic)
          problem("lidars", topic + " is named twice");
      }
      given.lidars.push_back(std::move(lidar));
    }
  }

  Given::Lidar read_lidar(const YAML::Node& node, const std::string& name) {
    Given::Lidar lidar;
    if (!node.IsMap()) {
      problem(name, "expected topic, body_from_lidar, late_s");
      return lidar;
    }
    for (const auto& entry : node) {
      const auto key = entry.first.as<std::string>("");
      const std::string full = name + "." + key;
      if (key == "topic") {
        lidar.listed.topic = entry.second.as<std::string>("");
      } else if (key == "lidar_model") {
        lidar.model = entry.second.as<std::string>("");
      } else if (key == "body_from_lidar") {
        lidar.body_from_lidar = read_pose(entry.second, full);
      } else if (key == "late_s") {
        lidar.listed.late_s = read_lateness(entry.second, full);
      } else {
        problem(full, "unknown key; expected topic, lidar_model, body_from_lidar or late_s");
      }
    }
    if (lidar.listed.topic.empty() || lidar.listed.topic.find(',') != std::string::npos)
      problem(name, "expected the topic of a lidar");
    return lidar;
  }

  double read_lateness(const YAML::Node& node, const std::string& key) {
    constexpr double kMostS = 10.0;  // a slip of unit is more
    const auto late_s = node.as<double>(std::nan(""));
    if (std::abs(late_s) <= kMostS) return late_s;
    problem(key, "expected seconds from -10 to 10");
    return 0.0;
  }

  void problem(const std::string& key, const std::string& what) {
    problems_.push_back(path_ + ": " + (key.empty() ? "" : key + ": ") + what);
  }

  std::vector<double> numbers(const YAML::Node& node, const std::string& key, std::size_t count) {
    try {
      const auto values = node.as<std::vector<double>>();
      bool finite = values.size() == count;
      for (const double value : values)
        finite = finite && std::isfinite(value);
      if (finite) return values;
    } catch (const YAML::Exception&) {
      // Told below.
    }
    problem(key, "expected " + std::to_string(count) + " numbers");
    return {};
  }

  Pose read_pose(const YAML::Node& node, const std::string& key) {
    Eigen::Vector3d translation = Eigen::Vector3d::Zero();
    Eigen::Quaterniond rotation = Eigen::Quaterniond::Identity();
    if (!node.IsMap()) {
      problem(key, "expected translation_m and a rotation");
      return {};
    }
    for (const auto& entry : node) {
      const auto name = entry.first.as<std::string>("");
      const std::string full = key + "." + name;
      if (name == "translation_m") {
        const auto v = numbers(entry.second, full, 3);
        if (!v.empty()) translation = {v[0], v[1], v[2]};
      } else if (name == "rotation_xyzw" || name == "rpy_deg" || name == "matrix") {
        rotation = read_rotation(entry.second, name, full);
      } else {
        problem(full, "unknown key; expected translation_m, rotation_xyzw, rpy_deg or matrix");
      }
    }
    return {rotation, translation};
  }

  Eigen::Quaterniond read_rotation(const YAML::Node& node, const std::string& name,
                                   const std::string& full) {
    Eigen::Quaterniond rotation = Eigen::Quaterniond::Identity();
    if (name == "rpy_deg") {
      const auto v = numbers(node, full, 3);
      if (v.empty()) return rotation;
      const auto turn = [](double deg, const Eigen::Vector3d& axis) {
        return Eigen::AngleAxisd(deg * std::numbers::pi / 180.0, axis);
      };
      return turn(v[2], Eigen::Vector3d::UnitZ()) * turn(v[1], Eigen::Vector3d::UnitY()) *
             turn(v[0], Eigen::Vector3d::UnitX());
    }
    if (name == "rotation_xyzw") {
      const auto v = numbers(node, full, 4);
      if (v.empty()) return rotation;
      rotation = Eigen::Quaterniond(v[3], v[0], v[1], v[2]);
      if (std::abs(rotation.norm() - 1.0) > 0.01) problem(full, "expected a unit quaternion");
      return rotation;
    }
    const auto v = numbers(node, full, 9);
    if (v.empty()) return rotation;
    Eigen::Matrix3d matrix;
    for (int i = 0; i < 9; ++i)
      matrix(i / 3, i % 3) = v[static_cast<std::size_t>(i)];
    if ((matrix * matrix.transpose() - Eigen::Matrix3d::Identity()).norm() > 0.01 ||
        matrix.determinant() < 0.0) {
      problem(full, "expected a rotation matrix");
      return rotation;
    }
    return Eigen::Quaterniond(matrix);
  }

  std::string path_;
  std::vector<std::string> problems_;
};

ExtrinsicsFile::Given read_extrinsics(const std::string& path) {
  ExtrinsicsFile file(path);
  ExtrinsicsFile::Given given = file.read(load_yaml(read_text_file(path), path));
  file.throw_problems();
  return given;
}

// Headings in the frame of the fixes say nothing of where the second antenna sits.
bool has_second_antenna(const SensorFrames& frames) {
  return !frames.second_gnss.empty() && frames.second_gnss != frames.gnss;
}

// The file's body from the recording's, by a sensor whose place is known on both.
std::optional<Pose> new_from_old_body(const ExtrinsicsFile::Given& given, const Rig& rig) {
  if (given.body_from_lidar) return *given.body_from_lidar * rig.body_from_lidar.inverse();
  if (given.body_from_imu && rig.body_from_imu)
    return *given.body_from_imu * rig.body_from_imu->inverse();
  if (given.body_from_gnss && rig.body_from_gnss)
    return *given.body_from_gnss * rig.body_from_gnss->inverse();
  return std::nullopt;
}

// Brings the recording's places onto another body.
void move_to_body(const std::string& path, const ExtrinsicsFile::Given& given, Rig& rig, Log& log) {
  const auto new_from_old = new_from_old_body(given, rig);
  const std::string& body = *given.body_frame;
  if (!new_from_old && rig.body_frame != "lidar") {
    throw ConfigError({path + ": body_frame: " + body + " is not the body of the recording (" +
                       rig.body_frame +
                       "), and nothing tells where the lidar sits on it: give "
                       "body_from_lidar"});
  }
  if (!new_from_old) {  // the lidar is all that the recording tells of
    log.warn("recording.extrinsics_body", path + ": nothing tells where the lidar sits on " + body +
                                              ": it is taken to sit in its origin");
  }
  const auto move = [&](const char* sensor, std::optional<Pose>& place, std::string& source) {
    if (!place) return;
    if (new_from_old) {
      place = *new_from_old * *place;
      source += ", moved to " + body + " by " + path;
      return;
    }
    log.warn("recording.extrinsics_body", path + ": nothing tells where the " + sensor +
                                              " sits on " + body + ": its place is dropped");
    place.reset();
    source = "none";
  };
  if (new_from_old) rig.body_from_lidar = *new_from_old * rig.body_from_lidar;
  if (!given.body_from_imu) move("IMU", rig.body_from_imu, rig.imu_extrinsic_source);
  if (!given.body_from_gnss) move("GNSS antenna", rig.body_from_gnss, rig.gnss_extrinsic_source);
  if (!given.body_from_second_gnss)
    move("second GNSS antenna", rig.body_from_second_gnss, rig.second_gnss_extrinsic_source);
}

// A file that does not name its body may mean another one than the recording has.
void remark_on_body(const std::string& path, const ExtrinsicsFile::Given& given, const Rig& rig,
                    Log& log) {
  std::string kept;
  const auto keep = [&](const char* sensor, const std::string& source) {
    if (source.rfind("/tf_static", 0) == 0 || source.rfind("sensor metadata", 0) == 0)
      kept += (kept.empty() ? "" : ", ") + std::string(sensor) + " by " + source;
  };
  if (given.body_frame) return;
  if (!given.body_from_lidar) keep("the lidar", rig.lidar_extrinsic_source);
  if (!given.body_from_imu) keep("the IMU", rig.imu_extrinsic_source);
  if (!given.body_from_gnss) keep("the GNSS antenna", rig.gnss_extrinsic_source);
  if (!given.body_from_second_gnss)
    keep("the second GNSS antenna", rig.second_gnss_extrinsic_source);
  const bool places = given.body_from_lidar || given.body_from_imu || given.body_from_gnss ||
                      given.body_from_second_gnss;
  if (kept.empty() || !places) return;
  log.warn("recording.extrinsics_body",
           path + ": names no body_frame: its places are taken to be on the recording's body (" +
               rig.body_frame + "), on which other sensors stay (" + kept + ")");
}

}  // namespace

bool TransformTree::add(const std::string& parent, const std::string& child,
                        const Pose& parent_from_child) {
  if (parent == child || parent.empty() || child.empty()) return false;
  const bool is_new = edges_[parent].try_emplace(child, parent_from_child).second;
  edges_[child].try_emplace(parent, parent_from_child.inverse());
  return is_new;
}

void TransformTree::save(BinaryWriter& writer) const {
  writer.put(static_cast<std::uint64_t>(edges_.size()));
  for (const auto& [frame, others] : edges_) {
    writer.put(frame);
    writer.put(static_cast<std::uint64_t>(others.size()));
    for (const auto& [other, frame_from_other] : others) {
      writer.put(other);
      put_pose(writer, frame_from_other);
    }
  }
}

void TransformTree::load(BinaryReader& reader) {
  edges_.clear();
  for (auto left = reader.get<std::uint64_t>(); left > 0; --left) {
    auto& others = edges_[reader.get_string()];
    for (auto more = reader.get<std::uint64_t>(); more > 0; --more) {
      const std::string other = reader.get_string();
      others[other] = get_pose(reader);
    }
  }
}

std::optional<Pose> TransformTree::find(const std::string& target,
                                        const std::string& source) const {
  if (target == source) return Pose();
  std::map<std::string, Pose> target_from{{target, Pose()}};
  std::deque<std::string> open{target};
  while (!open.empty()) {
    const std::string frame = open.front();
    open.pop_front();
    const auto edges = edges_.find(frame);
    if (edges == edges_.end()) continue;
    for (const auto& [next, frame_from_next] : edges->second) {
      if (target_from.count(next) > 0) continue;
      const Pose pose = target_from.at(frame) * frame_from_next;
      if (next == source) return pose;
      target_from.emplace(next, pose);
      open.push_back(next);
    }
  }
  return std::nullopt;
}

Rig rig_from_transforms(const TransformTree& tree, const SensorFrames& frames) {
  Rig rig;
  std::string body = frames.lidar;
  rig.body_frame = "lidar";
  if (tree.has_frame(kBaseFrame) && tree.find(kBaseFrame, frames.lidar)) {
    body = rig.body_frame = kBaseFrame;
  } else if (!frames.imu.empty() && tree.find(frames.imu, frames.lidar)) {
    body = frames.imu;
    rig.body_frame = "imu";
  }
  // A sensor whose messages carry the body's own frame sits in it.
  const auto source = [&](const std::string& frame) {
    return frame == body ? std::string("is the body frame") : std::string("/tf_static");
  };
  if (body != frames.lidar) {
    rig.body_from_lidar = *tree.find(body, frames.lidar);
    rig.lidar_extrinsic_source = "/tf_static";
  } else {
    rig.lidar_extrinsic_source = "is the body frame";
  }
  if (!frames.imu.empty()) rig.body_from_imu = tree.find(body, frames.imu);
  if (rig.body_from_imu) rig.imu_extrinsic_source = source(frames.imu);
  if (!frames.gnss.empty()) rig.body_from_gnss = tree.find(body, frames.gnss);
  if (rig.body_from_gnss) rig.gnss_extrinsic_source = source(frames.gnss);
  if (has_second_antenna(frames)) rig.body_from_second_gnss = tree.find(body, frames.second_gnss);
  if (rig.body_from_second_gnss) rig.second_gnss_extrinsic_source = source(frames.second_gnss);
  return rig;
}

bool complete_rig(const TransformTree& tree, const SensorFrames& frames, Rig& rig) {
  const std::string body = rig.body_frame == kBaseFrame ? kBaseFrame
                           : rig.body_frame == "imu"    ? frames.imu
                                                        : frames.lidar;
  const auto place = [&](const std::string& frame, std::optional<Pose>& body_from_sensor,
                         std::string& source) {
    if (frame.empty() || body_from_sensor) return false;
    body_from_sensor = tree.find(body, frame);
    if (body_from_sensor) source = frame == body ? "is the body frame" : "/tf_static";
    return body_from_sensor.has_value();
  };
  const bool imu = place(frames.imu, rig.body_from_imu, rig.imu_extrinsic_source);
  const bool gnss = place(frames.gnss, rig.body_from_gnss, rig.gnss_extrinsic_source);
  const bool second =
      has_second_antenna(frames) &&
      place(frames.second_gnss, rig.body_from_second_gnss, rig.second_gnss_extrinsic_source);
  return imu || gnss || second;
}

std::vector<ListedLidar> lidars_of_file(const std::string& path) {
  std::vector<ListedLidar> lidars;
  for (const ExtrinsicsFile::Given::Lidar& lidar : read_extrinsics(path).lidars)
    lidars.push_back(lidar.listed);
  return lidars;
}

double lateness_of_file(const std::string& path) {
  return read_extrinsics(path).late_s.value_or(0.0);
}

void apply_extrinsics_file(const std::string& path, const std::vector<std::string>& body_names,
                           Rig& rig, Log& log, int lidar_entry) {
  ExtrinsicsFile::Given given = read_extrinsics(path);
  given.use_entry(lidar_entry);
  if (given.lidar_model) rig.lidar_model = *given.lidar_model;
  if (given.body_frame && *given.body_frame != rig.body_frame &&
      std::find(body_names.begin(), body_names.end(), *given.body_frame) == body_names.end()) {
    move_to_body(path, given, rig, log);
  } else {
    remark_on_body(path, given, rig, log);
  }
  if (given.body_frame) rig.body_frame = *given.body_frame;
  const std::string source = "extrinsics file " + path;
  if (given.body_from_lidar) {
    rig.body_from_lidar = *given.body_from_lidar;
    rig.lidar_extrinsic_source = source;
  }
  if (given.body_from_imu) {
    rig.body_from_imu = given.body_from_imu;
    rig.imu_extrinsic_source = source;
  }
  if (given.body_from_gnss) {
    rig.body_from_gnss = given.body_from_gnss;
    rig.gnss_extrinsic_source = source;
  }
  if (given.body_from_second_gnss) {
    rig.body_from_second_gnss = given.body_from_second_gnss;
    rig.second_gnss_extrinsic_source = source;
  }
}

}  // namespace understory
