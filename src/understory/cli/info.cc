#include <cstdio>
#include <memory>
#include <nlohmann/json.hpp>
#include <string>

#include "understory/cli/command.h"
#include "understory/cli/open_options.h"
#include "understory/cli/suggestion.h"
#include "understory/cli/terminal.h"
#include "understory/pipeline/source.h"
#include "understory/recording/recording_info.h"

namespace understory {
namespace {

struct InfoOptions {
  std::string recording;
  OpenOptions open;
  bool json = false;
};

double rate_of(const TopicReport& topic) {
  const double span = to_seconds(topic.last_stamp - topic.first_stamp);
  return topic.messages > 1 && span > 0.0 ? static_cast<double>(topic.messages - 1) / span : 0.0;
}

nlohmann::json vector_json(const Eigen::Vector3d& v) {
  return {v.x(), v.y(), v.z()};
}

nlohmann::json pose_json(const Pose& pose) {
  const Eigen::Quaterniond& q = pose.rotation();
  return {{"translation_m", vector_json(pose.translation())},
          {"rotation_xyzw", {q.x(), q.y(), q.z(), q.w()}}};
}

nlohmann::json topic_json(const TopicReport& topic) {
  return {{"name", topic.name},
          {"type", topic.type},
          {"frame", topic.frame},
          {"role", topic.role},
          {"conventions", topic.conventions},
          {"messages", topic.messages},
          {"rate_hz", rate_of(topic)},
          {"first_stamp_s", format_seconds(topic.first_stamp)},
          {"last_stamp_s", format_seconds(topic.last_stamp)},
          {"longest_gap_s", to_seconds(topic.longest_gap)},
          {"backward_steps", topic.backward_steps},
          {"duplicates", topic.duplicates},
          {"unreadable", topic.unreadable},
          {"not_numbers", topic.not_numbers},
          {"left_out", topic.left_out},
          {"points", topic.points},
          {"empty_points", topic.empty_points}};
}

nlohmann::json rig_json(const Rig& rig) {
  nlohmann::json json = {{"body_frame", rig.body_frame},
                         {"body_from_lidar", pose_json(rig.body_from_lidar)},
                         {"lidar_source", rig.lidar_extrinsic_source},
                         {"imu_source", rig.imu_extrinsic_source},
                         {"gnss_source", rig.gnss_extrinsic_source},
                         {"second_gnss_source", rig.second_gnss_extrinsic_source}};
  json["body_from_further_lidars"] = nlohmann::json::array();
  for (const FurtherLidar& lidar : rig.further_lidars)
    json["body_from_further_lidars"].push_back(
        pose_json(rig.body_from_lidar * lidar.lidar_from_further));
  json["body_from_imu"] = rig.body_from_imu ? pose_json(*rig.body_from_imu) : nlohmann::json();
  json["body_from_gnss"] = rig.body_from_gnss ? pose_json(*rig.body_from_gnss) : nlohmann::json();
  json["body_from_second_gnss"] =
      rig.body_from_second_gnss ? pose_json(*rig.body_from_second_gnss) : nlohmann::json();
  return json;
}

nlohmann::json lidar_json(const RecordingInfo& info) {
  const RecordingInfo::Lidar& lidar = info.lidar;
  return {{"model", info.rig.lidar_model},
          {"scans", lidar.scans},
          {"points", lidar.points},
          {"rate_hz", lidar.rate_hz},
          {"rings", lidar.ring_count},
          {"scan_duration_s", lidar.scan_duration_s},
          {"scans_without_point_times", lidar.scans_without_point_times},
          {"empty_scans", lidar.empty_scans},
          {"outages", lidar.outages},
          {"longest_gap_s", lidar.longest_gap_s},
          {"backward_steps", lidar.backward_steps},
          {"duplicates", lidar.duplicates},
          {"nearest_m", lidar.nearest_m},
          {"farthest_m", lidar.farthest_m},
          {"first_stamp_s", format_seconds(lidar.first)},
          {"end_s", format_seconds(lidar.last)}};
}

nlohmann::json imu_json(const RecordingInfo::Imu& imu) {
  return {{"samples", imu.samples},
          {"rate_hz", imu.rate_hz},
          {"longest_gap_s", imu.longest_gap_s},
          {"backward_steps", imu.backward_steps},
          {"duplicates", imu.duplicates},
          {"mean_specific_force_m_s2", imu.mean_specific_force_m_s2},
          {"mean_angular_rate_rad_s", imu.mean_angular_rate_rad_s},
          {"highest_angular_rate_rad_s", imu.highest_angular_rate_rad_s},
          {"gravity", imu.gravity},
          {"up_in_imu", vector_json(imu.up_in_imu)},
          {"up_in_body", vector_json(imu.up_in_body)},
          {"orientation", imu.has_orientation},
          {"gyroscope_axes", imu.gyroscope_axes}};
}

void print_json(const RecordingInfo& info) {
  nlohmann::json json = {
      {"path", info.path},           {"format", info.format},           {"complete", info.complete},
      {"one_cloud", info.one_cloud}, {"duration_s", info.duration_s},   {"lidar", lidar_json(info)},
      {"imu", imu_json(info.imu)},   {"mag_samples", info.mag_samples}, {"rig", rig_json(info.rig)},
      {"warnings", info.warnings}};
  json["gnss"] = {{"fixes", info.gnss.fixes},
                  {"valid", info.gnss.valid},
                  {"headings", info.gnss.headings},
                  {"rate_hz", info.gnss.rate_hz},
                  {"best_quality", info.gnss.best_quality}};
  json["topics"] = nlohmann::json::array();
  for (const TopicReport& topic : info.topics)
    json["topics"].push_back(topic_json(topic));
  std::puts(json.dump(2, ' ', false, nlohmann::json::error_handler_t::replace).c_str());
}

void print_topics(const RecordingInfo& info) {
  std::printf("\ntopics\n");
  for (const TopicReport& topic : info.topics) {
    std::printf("  %-28s %-8s %8llu messages %8.2f Hz", topic.name.c_str(), topic.role.c_str(),
                static_cast<unsigned long long>(topic.messages), rate_of(topic));
    if (topic.longest_gap > 0) std::printf("  longest gap %.3f s", to_seconds(topic.longest_gap));
    std::printf("\n    %s%s%s\n", topic.type.c_str(), topic.frame.empty() ? "" : ", frame ",
                topic.frame.c_str());
    if (!topic.conventions.empty()) std::printf("    %s\n", topic.conventions.c_str());
    if (topic.empty_points > 0)
      std::printf("    %llu points without a return were left out\n",
                  static_cast<unsigned long long>(topic.empty_points));
  }
}

void print_lidar(const RecordingInfo& info) {
  const RecordingInfo::Lidar& lidar = info.lidar;
  if (lidar.scans == 0) return;
  std::printf("\nlidar     %s\n",
              info.rig.lidar_model.empty() ? "model unknown" : info.rig.lidar_model.c_str());
  std::printf("  %llu scans at %.2f Hz, %.0f points each, %s rings, ranges %.1f to %.1f m\n",
              static_cast<unsigned long long>(lidar.scans), lidar.rate_hz,
              static_cast<double>(lidar.points) / static_cast<double>(lidar.scans),
              lidar.ring_count > 0 ? std::to_string(lidar.ring_count).c_str() : "unknown",
              lidar.nearest_m, lidar.farthest_m);
  std::printf("  longest gap %.3f s; a scan lasts up to %.4f s\n", lidar.longest_gap_s,
              lidar.scan_duration_s);
}

void print_imu(const RecordingInfo::Imu& imu) {
  if (imu.samples == 0) return;
  std::printf("\nimu\n  %llu samples at %.1f Hz, longest gap %.3f s%s\n",
              static_cast<unsigned long long>(imu.samples), imu.rate_hz, imu.longest_gap_s,
              imu.has_orientation ? ", with orientation" : "");
  std::printf(
      "  mean specific force %.3f m/s^2, gravity %s; mean angular rate %.3f rad/s, "
      "highest %.2f\n",
      imu.mean_specific_force_m_s2, imu.gravity.c_str(), imu.mean_angular_rate_rad_s,
      imu.highest_angular_rate_rad_s);
  const Eigen::Vector3d& up = imu.up_in_imu;
  if (up.norm() > 0.5)
    std::printf("  up is (%s) in the IMU's frame\n",
                number_row({up.x(), up.y(), up.z()}, 2, ", ").c_str());
  std::printf("  axes of gyroscope and accelerometer: %s\n",
              imu.gyroscope_axes.empty()      ? "too little tilting to tell"
              : imu.gyroscope_axes == "x y z" ? "agree"
                                              : "disagree");
}

void print_pose(const char* name, const std::optional<Pose>& pose, const std::string& source) {
  if (!pose) {
    std::printf("  %s: unknown\n", name);
    return;
  }
  const Eigen::Vector3d& t = pose->translation();
  const Eigen::Quaterniond& q = pose->rotation();
  std::printf("  %s: (%s) m, quaternion xyzw (%s); %s\n", name,
              number_row({t.x(), t.y(), t.z()}, 4, ", ").c_str(),
              number_row({q.x(), q.y(), q.z(), q.w()}, 5, ", ").c_str(), source.c_str());
}

// Of one cloud nothing is said of rates, gaps and extrinsics: it has none.
void print_cloud(const RecordingInfo& info) {
  std::printf("%s\n  %s, %llu points, %.1f to %.1f m from its origin\n", info.path.c_str(),
              info.format.c_str(), static_cast<unsigned long long>(info.lidar.points),
              info.lidar.nearest_m, info.lidar.farthest_m);
  std::printf("\nnext      understory inventory %s -o DIR\n", info.path.c_str());
}

void print_warnings(const RecordingInfo& info) {
  std::printf("\nwarnings  %s\n", info.warnings.empty() ? "none" : "");
  for (const std::string& warning : info.warnings)
    std::printf("  - %s\n", warning.c_str());
}

void print_text(const RecordingInfo& info) {
  if (info.one_cloud) {
    print_cloud(info);
    return print_warnings(info);
  }
  std::printf("%s\n  %s, %.2f s%s\n", info.path.c_str(), info.format.c_str(), info.duration_s,
              info.complete ? "" : " (stopped before the end)");
  print_topics(info);
  print_lidar(info);
  print_imu(info.imu);
  if (info.gnss.fixes > 0)
    std::printf("\ngnss\n  %llu fixes at %.2f Hz, %llu valid, best quality %d\n",
                static_cast<unsigned long long>(info.gnss.fixes), info.gnss.rate_hz,
                static_cast<unsigned long long>(info.gnss.valid), info.gnss.best_quality);
  if (info.gnss.headings > 0)
    std::printf("  %llu headings of a second antenna\n",
                static_cast<unsigned long long>(info.gnss.headings));
  std::printf("\nextrinsics (body is %s)\n", info.rig.body_frame.c_str());
  print_pose("body_from_lidar", info.rig.body_from_lidar, info.rig.lidar_extrinsic_source);
  int number = 1;
  for (const FurtherLidar& lidar : info.rig.further_lidars)
    print_pose(("body_from_lidar " + std::to_string(++number)).c_str(),
               info.rig.body_from_lidar * lidar.lidar_from_further,
               info.rig.lidar_extrinsic_source);
  if (info.imu.samples > 0)
    print_pose("body_from_imu", info.rig.body_from_imu, info.rig.imu_extrinsic_source);
  if (info.gnss.fixes > 0)
    print_pose("body_from_gnss", info.rig.body_from_gnss, info.rig.gnss_extrinsic_source);
  if (info.gnss.headings > 0)
    print_pose("body_from_second_gnss", info.rig.body_from_second_gnss,
               info.rig.second_gnss_extrinsic_source);
  print_warnings(info);
}

int run_info(const InfoOptions& options, CommandContext& context) {
  refuse_run(options.recording);
  refuse_stems(options.recording);
  Log log;  // its warnings are part of the result
  const std::unique_ptr<Recording> recording = open_source(options.recording, options.open, log);
  RecordingSurvey survey;
  bool stopped = false;
  std::uint64_t events = 0;
  while (const auto event = recording->next()) {
    survey.add(*event);
    if (++events % 256 != 0) continue;
    context.progress({"reading", 100.0 * recording->progress(), 100.0, "%", ""});
    stopped = context.stop_requested();
    if (stopped) break;
  }
  RecordingInfo info = survey.finish(options.recording, *recording, log);
  info.complete = !stopped;
  options.json ? print_json(info) : print_text(info);
  return stopped ? kExitUntrusted : kExitDone;
}

}  // namespace

void add_info_command(CLI::App& app, Command& chosen) {
  auto options = std::make_shared<InfoOptions>();
  CLI::App* command =
      app.add_subcommand("info", "What is in a recording, and which conventions were detected");
  command->add_option("RECORDING", options->recording, "File or folder, or sim:SITE?key=value")
      ->required();
  command->add_flag("--json", options->json, "Print one JSON object");
  add_open_options(*command, options->open);
  command->footer("Example:\n  understory info walk.mcap");
  command->callback([options, &chosen] {
    chosen = [options](CommandContext& context) { return run_info(*options, context); };
  });
}

}  // namespace understory
