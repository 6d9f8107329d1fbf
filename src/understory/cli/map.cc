#include <fmt/format.h>
#include <fmt/ranges.h>

#include <cstdio>
#include <functional>
#include <memory>

#include "understory/cli/command.h"
#include "understory/cli/open_options.h"
#include "understory/cli/outcome.h"
#include "understory/cli/plot_options.h"
#include "understory/cli/suggestion.h"
#include "understory/pipeline/mapping/dense/dense_mapping_config.h"
#include "understory/pipeline/mapping/front_end_config.h"
#include "understory/pipeline/mapping/mapping.h"
#include "understory/pipeline/run_folder/run_folder.h"
#include "understory/pipeline/source.h"
#include "understory/util/error.h"
#include "understory/util/files/output_guard.h"
#include "understory/util/shell_word.h"

namespace understory {
namespace {

struct MapOptions {
  std::string recording;
  std::string run_folder;
  std::string resume;
  std::string profile;
  std::string config_file;
  std::vector<std::string> settings;
  std::string coordinate_system;
  std::string inventory;
  PlotOptions plots;
  std::string front_end = kDenseFrontEnd;
  bool imu_rate = false;
  bool refine_imu = false;
  bool realtime = false;
  bool copc = false;
  std::string max_memory_mb;
  bool overwrite = false;
  bool print_config = false;
  OpenOptions open;
};

// What a run that was stopped or could not be written can do about it.
int with_advice(const std::string& run_folder, const std::function<int()>& work) {
  try {
    return work();
  } catch (const Stopped&) {
    if (!holds_unfinished_run(run_folder)) throw;
    return report_stop("the scans are positioned, and no map was made; go on with `" +
                       resume_command(run_folder) + "`");
  } catch (const RefusedOutput&) {
    throw;
  } catch (const OutputError& error) {
    const std::string said = error.what();
    if (!holds_unfinished_run(run_folder) || said.find("--resume") != said.npos) throw;
    const std::string file = error.file() + ": ";
    throw OutputError(error.file(), said.substr(said.rfind(file, 0) == 0 ? file.size() : 0) +
                                        "; what was mapped so far is kept: make room and go on "
                                        "with `" +
                                        resume_command(run_folder) + "`");
  }
}

// Without a recording the values asked for; with one those that would run on it.
int print_config(const MapOptions& options, const ReadConfig<FrontEndConfig>& read,
                 CommandContext& context) {
  SensorTraits traits;
  if (!options.recording.empty()) {
    static_cast<void>(
        learn_traits(open_source(options.recording, options.open, context.log), traits));
    std::fputs(("# " + to_string(traits) + "\n").c_str(), stdout);
  } else {
    traits.has_imu = true;  // unknown: nothing is adapted to it
  }
  RunConditions conditions;
  conditions.realtime = options.realtime;
  const auto adapted = adapt_front_end(read.config, read.origins, traits, conditions);
  std::fputs(commented_yaml(adapted, read.origins).c_str(), stdout);
  return kExitDone;
}

// A resumed run keeps what it was begun with.
void refuse_beside_resume(const CLI::App& command) {
  std::string given;
  for (const CLI::Option* option : command.get_options()) {
    if (option->count() == 0 || option->get_name() == "--resume") continue;
    given += (given.empty() ? "" : ", ") + option->get_name();
  }
  if (given.empty()) return;
  throw ConfigError({"--resume goes on with what the run was begun with, and does not take: " +
                     given + " (to change it, map the recording anew)"});
}

// What the options set, of maps of all points alone: one that a run by stems has no use for is
// refused.
void set_of_dense(const MapOptions& options, std::vector<std::string>& settings) {
  const auto set = [&](bool given, const char* why_not, const std::string& setting) {
    if (!given) return;
    if (options.front_end != kDenseFrontEnd)
      throw ConfigError({std::string(why_not) + ": leave it out, or map with --front-end dense"});
    settings.push_back(setting);
  };
  set(!options.inventory.empty(),
      "--inventory measures the cloud of a map, which a run by stems does not make",
      "inventory.extent=" + options.inventory);
  set(options.imu_rate,
      "--imu-rate predicts from positioned scans, which a run by stems does not have",
      "imu_rate=true");
  set(options.refine_imu,
      "--refine-imu refines by positioned scans of all points, which a run by stems does not have",
      "refine_imu=true");
  set(options.copc, "--copc writes the cloud of a map, which a run by stems does not make",
      "map.copc=true");
  set(!options.max_memory_mb.empty(),
      "--max-memory-mb bounds a map of all points; a run by stems takes some 300 MB of any "
      "recording",
      "run.max_memory_mb=" + options.max_memory_mb);
}

std::vector<std::string> settings_of(const MapOptions& options) {
  std::vector<std::string> settings = options.settings;
  if (!options.coordinate_system.empty())
    settings.push_back("georeference.crs=" + options.coordinate_system);
  set_of_dense(options, settings);
  const std::vector<std::string> plots = plot_settings(options.plots, "inventory.stand.");
  if (!plots.empty() && options.front_end != kDenseFrontEnd)
    throw ConfigError(
        {"--plots and --plot-grid need the cloud of a map, and a run by stems makes none: leave "
         "them out, or map with --front-end dense"});
  settings.insert(settings.end(), plots.begin(), plots.end());
  return settings;
}

int run_map(const MapOptions& options, CommandContext& context) {
  const auto run = [&](MappingRun begun) {
    return report_outcome(
        run_mapping(std::move(begun), context.log, context.progress, context.stop_requested));
  };
  if (!options.resume.empty())
    return with_advice(options.resume, [&] { return run(reopen_mapping(options.resume)); });
  refuse_cloud(options.recording);
  refuse_stems(options.recording);
  const std::vector<std::string> settings = settings_of(options);
  ReadConfig<FrontEndConfig> read = read_front_end_config(
      options.front_end, options.profile, options.config_file, settings, context.log);
  if (options.print_config) return print_config(options, read, context);
  if (options.recording.empty() || options.run_folder.empty()) {
    throw ConfigError(
        {options.recording.empty()
             ? "map needs a RECORDING and -o RUN, the folder to write (or --resume RUN)"
             : "map needs -o RUN, the folder to write: `understory map " +
                   shell_word(options.recording) + " -o RUN`"});
  }
  MappingRequest request;
  request.recording = options.recording;
  request.run_folder = options.run_folder;
  request.config = std::move(read.config);
  request.config_record.origins = std::move(read.origins);
  request.config_record.asked_yaml = yaml_of(request.config);
  std::vector<std::string> files = files_named_in(request.config);
  files.push_back(options.config_file);
  refuse_run_over_inputs(request.run_folder, request.recording, options.open, files);
  request.open = options.open;
  request.realtime = options.realtime;
  request.overwrite = options.overwrite;
  return with_advice(options.run_folder, [&] { return run(begin_mapping(request)); });
}

}  // namespace

void add_map_command(CLI::App& app, Command& chosen) {
  auto* command = app.add_subcommand("map", "Map a recording: trajectory, map, trees, report");
  const auto options = std::make_shared<MapOptions>();
  command->add_option("RECORDING", options->recording,
                      "Recording (file, folder or sim:SITE?seed=N)");
  command->add_option("-o,--output", options->run_folder, "Run folder to write");
  command->add_option("--resume", options->resume, "Go on where a killed run stopped");
  command->add_option("--profile", options->profile,
                      fmt::format("Shipped settings: {}", fmt::join(profile_names(), ", ")));
  command->add_option("--config", options->config_file, "YAML file of settings");
  add_settings_option(*command, options->settings);
  command
      ->add_option("--front-end", options->front_end,
                   "How scans are positioned: all points (dense) or stems alone (sparse)")
      ->check(CLI::IsMember({kDenseFrontEnd, kSparseFrontEnd}));
  command->add_option("--crs", options->coordinate_system,
                      "Coordinate system of map.laz, rasters and trees.gpkg where the recording "
                      "has GNSS: EPSG:3067 or WKT (if not given ETRS-TM35FIN in Finland, else the "
                      "UTM zone)");
  command
      ->add_option(
          "--inventory", options->inventory,
          "What is measured of the trees. basic (if not given): diameters and heights. "
          "full: also stem curves, volumes, crowns, the tree of each point, thin and far trees")
      ->check(CLI::IsMember({"basic", "full"}));
  add_plot_options(*command, options->plots);
  command->add_flag("--copc", options->copc,
                    "Write map.copc.laz as well: the points of map.laz as Cloud Optimized Point "
                    "Cloud, which QGIS and web viewers show at once");
  command->add_option("--max-memory-mb", options->max_memory_mb,
                      "Most memory that the run may take, in MB of 10^6 bytes (if not given, no "
                      "limit). What does not fit is held on disk");
  command->add_flag("--imu-rate", options->imu_rate,
                    "Write trajectory_imu.tum as well: a predicted pose for each sample of the "
                    "IMU");
  command->add_flag("--refine-imu", options->refine_imu,
                    "Refine place and clock of the IMU while mapping; where they differ from what "
                    "is given, the recording is mapped anew with them");
  command->add_flag("--realtime", options->realtime,
                    "Play the recording at the speed of the sensor; scans that come too late are "
                    "left out (sets time_repair.window_s, and by stems also "
                    "stems.pace.longest_gap_s, to 0)");
  command->add_flag("--overwrite", options->overwrite,
                    "Start anew although the run folder holds a run, finished or not");
  command->add_flag(
      "--print-config", options->print_config,
      "Print every setting with default, unit, range and meaning; with a RECORDING the "
      "values that would run on it, and why");
  add_open_options(*command, options->open);
  command->footer(
      "Examples:\n  understory map plot7.mcap -o plot7 --profile handheld\n"
      "  understory map 'sim:handheld?seed=3' -o run --set loop_closure.enabled=false\n"
      "  understory map sim:lieksa2 -o forest --front-end sparse");
  command->callback([&chosen, options, command] {
    chosen = [options, command](CommandContext& context) {
      if (!options->resume.empty()) refuse_beside_resume(*command);
      return run_map(*options, context);
    };
  });
}

}  // namespace understory
