#include "understory/pipeline/mapping/run_state.h"

#include <utility>
#include <vector>

#include "understory/util/error.h"
#include "understory/util/version.h"

namespace understory {
namespace {

void put_request(BinaryWriter& writer, const MappingRequest& request) {
  const OpenOptions& open = request.open;
  for (const std::string& text :
       {std::string(kVersion), request.recording, request.config_record.asked_yaml,
        open.metadata_file, open.lidar_topic, open.imu_topic, open.gnss_topic,
        open.extrinsics_file}) {
    writer.put(text);
  }
  writer.put(open.rate_hz);
  writer.put(request.realtime);
  put_origins(writer, request.config_record.origins);
  put_traits(writer, request.traits);
  put_conditions(writer, request.conditions);
  const bool again = !request.begun_in.empty();
  writer.put((again ? request.begun_in : std::filesystem::current_path()).string());
}

void get_request(BinaryReader& reader, const std::filesystem::path& path, MappingRequest& request) {
  const std::string version = reader.get_string();
  if (version != kVersion) {
    throw InputError(
        path.string(), "",
        "was written by version " + version + ", this is " + kVersion + ": map the recording anew");
  }
  request.recording = reader.get_string();
  request.config_record.asked_yaml = reader.get_string();
  OpenOptions& open = request.open;
  for (std::string* text : {&open.metadata_file, &open.lidar_topic, &open.imu_topic,
                            &open.gnss_topic, &open.extrinsics_file}) {
    *text = reader.get_string();
  }
  open.rate_hz = reader.get<double>();
  request.realtime = reader.get<bool>();
  request.config_record.origins = get_origins(reader);
  request.traits = get_traits(reader);
  request.conditions = get_conditions(reader);
  const std::filesystem::path begun_in = reader.get_string();
  request.begun_in = begun_in == std::filesystem::current_path() ? "" : begun_in;
  for (std::string* file : {&request.recording, &open.metadata_file, &open.extrinsics_file})
    *file = request.found(*file);
}

void put_inputs(BinaryWriter& writer, const std::vector<InputIdentity>& inputs) {
  writer.put(static_cast<std::uint64_t>(inputs.size()));
  for (const InputIdentity& input : inputs) {
    for (const std::string& text : {input.what, input.path, input.mark})
      writer.put(text);
  }
}

std::vector<InputIdentity> get_inputs(BinaryReader& reader) {
  std::vector<InputIdentity> inputs;
  for (auto left = reader.get<std::uint64_t>(); left > 0; --left) {
    InputIdentity& input = inputs.emplace_back();
    for (std::string* text : {&input.what, &input.path, &input.mark})
      *text = reader.get_string();
  }
  return inputs;
}

void put_files(BinaryWriter& writer, const std::vector<CountedFile>& files) {
  writer.put(static_cast<std::uint64_t>(files.size()));
  for (const CountedFile& file : files) {
    writer.put(file.name);
    writer.put(file.count);
  }
}

// Reads all records that a checkpoint counts on. Throws InputError at the first that is not whole.
void check_files(BinaryReader& reader, const std::filesystem::path& work) {
  for (auto left = reader.get<std::uint64_t>(); left > 0; --left) {
    const std::string name = reader.get_string();
    for_each_record(work / name, reader.get<RecordCount>(),
                    [](std::uint64_t /*offset*/, RecordFile::Bytes /*bytes*/) {});
  }
}

std::string joined(const std::vector<std::string>& problems) {
  std::string text;
  for (const std::string& problem : problems)
    text += (text.empty() ? "" : "; ") + problem;
  return text;
}

[[noreturn]] void nothing_whole(const std::filesystem::path& run_folder,
                                const std::vector<std::string>& problems) {
  throw InputError(run_folder.string(), "",
                   "no checkpoint of this run is whole (" + joined(problems) +
                       "); nothing was changed: map the recording anew with --overwrite");
}

}  // namespace

RunState RunState::create(const MappingRequest& request) {
  return {RunFolder::claim(request.run_folder, request.overwrite), name_of(request.config)};
}

void RunState::check_inputs(const MappingRequest& request) {
  std::vector<InputIdentity> now = request.identify_inputs();
  if (resumed()) expect_same(inputs_, now);
  inputs_ = std::move(now);
}

UnfinishedRun RunState::reopen(const std::filesystem::path& run_folder) {
  RunFolder folder = RunFolder::reclaim(run_folder);
  UnfinishedRun run{MappingRequest(), RunState(std::move(folder), "")};
  std::vector<std::string> problems;
  for (const Checkpoint& checkpoint : read_checkpoints(run.state.work(), problems)) {
    try {
      run.state.read(checkpoint, run.request);
      run.request.run_folder = run_folder;
      run.state.passed_over_ = joined(problems);
      return run;
    } catch (const InputError& problem) {
      problems.emplace_back(problem.what());
    }
  }
  nothing_whole(run_folder, problems);
}

void RunState::read(const Checkpoint& checkpoint, MappingRequest& request) {
  file_ = checkpoint.file.string();
  BinaryReader reader(checkpoint.bytes, file_);
  get_request(reader, checkpoint.file, request);
  inputs_ = get_inputs(reader);
  front_end_ = reader.get_string();
  events_ = reader.get<std::uint64_t>();
  last_checkpoint_ = reader.get<TimeNs>();
  earlier_s_ = reader.get<double>();
  check_files(reader, work());
  place_.reset();
  if (reader.get<bool>()) place_ = reader.get_string();
  state_ = reader.get_string();
  next_ = checkpoint.number + 1;
  resumed_ = true;
}

double RunState::elapsed_s() const {
  return earlier_s_ +
         std::chrono::duration<double>(std::chrono::steady_clock::now() - start_).count();
}

void RunState::find_place(Recording& source) const {
  if (!place_) return source.skip(events_);
  BinaryReader reader(*place_, file_);
  source.load(reader);
}

void RunState::restore(Resumable& session, EventOrderer& orderer, Log& log, const Rig& rig) const {
  UNDERSTORY_CHECK(resumed());
  BinaryReader reader(state_, file_);
  std::vector<Log::Warning> warnings;
  for (auto left = reader.get<std::uint64_t>(); left > 0; --left) {
    Log::Warning& warning = warnings.emplace_back();
    warning.key = reader.get_string();
    warning.first_message = reader.get_string();
    warning.count = reader.get<std::uint64_t>();
  }
  orderer.load(reader);
  session.load(reader, rig);
  log.restore(warnings);
  log.info(last_checkpoint_ == 0 ? "goes on at the beginning of the recording"
                                 : "goes on at " + format_seconds(last_checkpoint_) + " s");
  if (passed_over_.empty()) return;
  log.warn("run.older_checkpoint",
           "the newest checkpoint is not whole (" + passed_over_ +
               "): the run goes on from the one before, and maps a few seconds again");
}

void RunState::save(const MappingRequest& request, Resumable& session, const EventOrderer& orderer,
                    const Log& log, const Recording& source, std::uint64_t events) {
  session.sync();
  BinaryWriter state(state_bytes_ + state_bytes_ / 4);
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
  state_bytes_ = state.bytes().size();
  constexpr std::size_t kBesideState = 1 << 16;
  BinaryWriter writer(state_bytes_ + kBesideState);
  put_request(writer, request);
  put_inputs(writer, inputs_);
  writer.put(front_end_);
  writer.put(events);
  writer.put(last_checkpoint_);
  writer.put(elapsed_s());
  put_files(writer, session.files());
  BinaryWriter place;
  const bool told = source.save(place);
  writer.put(told);
  if (told) writer.put(place.bytes());
  writer.put(state.bytes());
  write_checkpoint(work(), next_++, writer.bytes());
}

void RunState::begin_anew(const MappingRequest& request, Resumable& session,
                          const EventOrderer& orderer, const Log& log, const Recording& source) {
  for (int generation = 0; generation < 2; ++generation)
    save(request, session, orderer, log, source, 0);
}

}  // namespace understory
