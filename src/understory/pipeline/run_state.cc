#include "understory/pipeline/run_state.h"

#include "understory/pipeline/checkpoint.h"
#include "understory/util/error.h"
#include "understory/util/version.h"

namespace understory {
namespace {

constexpr const char* kCheckpoint = "checkpoint.bin";

void put_request(BinaryWriter& writer, const RunRequest& request) {
  const OpenOptions& open = request.open;
  for (const std::string& text :
       {std::string(kVersion), request.recording, request.config_yaml, open.metadata_file,
        open.lidar_topic, open.imu_topic, open.gnss_topic, open.extrinsics_file}) {
    writer.put(text);
  }
  writer.put(open.rate_hz);
  writer.put(request.realtime);
  put_origins(writer, request.config_origins);
  put_traits(writer, request.traits);
  put_conditions(writer, request.conditions);
}

void get_request(BinaryReader& reader, const std::filesystem::path& path, RunRequest& request) {
  const std::string version = reader.get_string();
  if (version != kVersion) {
    throw InputError(
        path.string(), "",
        "was written by version " + version + ", this is " + kVersion + ": map the recording anew");
  }
  request.recording = reader.get_string();
  request.config_yaml = reader.get_string();
  OpenOptions& open = request.open;
  for (std::string* text : {&open.metadata_file, &open.lidar_topic, &open.imu_topic,
                            &open.gnss_topic, &open.extrinsics_file}) {
    *text = reader.get_string();
  }
  open.rate_hz = reader.get<double>();
  request.realtime = reader.get<bool>();
  request.config_origins = get_origins(reader);
  request.traits = get_traits(reader);
  request.conditions = get_conditions(reader);
}

}  // namespace

RunState RunState::create(const RunRequest& request, const std::string& front_end) {
  return {RunFolder::claim(request.run_folder, request.overwrite), front_end};
}

RunState RunState::reopen(const std::filesystem::path& run_folder, RunRequest& request) {
  RunState state(RunFolder::reclaim(run_folder), "");
  state.resumed_ = true;
  const std::filesystem::path path = state.work() / kCheckpoint;
  BinaryReader reader(read_checkpoint(path), path.string());
  request.run_folder = run_folder;
  get_request(reader, path, request);
  state.front_end_ = reader.get_string();
  state.events_ = reader.get<std::uint64_t>();
  state.last_checkpoint_ = reader.get<TimeNs>();
  state.state_ = reader.get_string();
  return state;
}

void RunState::restore(Resumable& session, EventOrderer& orderer, Log& log, const Rig& rig) const {
  if (events_ == 0) return;
  BinaryReader reader(state_, (work() / kCheckpoint).string());
  std::vector<Log::Warning> warnings(reader.get<std::uint64_t>());
  for (Log::Warning& warning : warnings) {
    warning.key = reader.get_string();
    warning.first_message = reader.get_string();
    warning.count = reader.get<std::uint64_t>();
  }
  orderer.load(reader);
  session.load(reader, rig);
  log.restore(warnings);
}

void RunState::save(const RunRequest& request, Resumable& session, const EventOrderer& orderer,
                    const Log& log, std::uint64_t events) {
  session.flush();
  BinaryWriter state;
  const auto warnings = log.warnings();
  state.put(static_cast<std::uint64_t>(warnings.size()));
  for (const Log::Warning& warning : warnings) {
    state.put(warning.key);
    state.put(warning.first_message);
    state.put(static_cast<std::uint64_t>(warning.count));
  }
  orderer.save(state);
  session.save(state);
  last_checkpoint_ = session.last_scan_end();
  BinaryWriter writer;
  put_request(writer, request);
  writer.put(front_end_);
  writer.put(events);
  writer.put(last_checkpoint_);
  writer.put(state.bytes());
  write_checkpoint(work() / kCheckpoint, writer.bytes());
}

}  // namespace understory
