#include <cstdio>
#include <memory>
#include <string>
#include <utility>
#include <vector>

#include "understory/cli/command.h"
#include "understory/cli/outcome.h"
#include "understory/cli/plot_options.h"
#include "understory/cli/suggestion.h"
#include "understory/pipeline/inventory/cloud_inventory.h"
#include "understory/util/error.h"
#include "understory/util/shell_word.h"

namespace understory {
namespace {

struct InventoryOptions {
  InventoryRequest request;
  std::vector<std::string> settings;
  PlotOptions plots;
  bool copc = false;
  bool print_config = false;
};

void add_cloud_frame_options(CLI::App& command, CloudFrame& frame) {
  command
      .add_option("--unit-m", frame.unit_m,
                  "Metres per unit of the cloud: 0.001 for millimetres, 0.3048 for feet (if not "
                  "given, 1, which is checked)")
      ->check(CLI::Range(1e-6, 1e6));
  command
      .add_option("--up", frame.up,
                  "The cloud's direction that points up: x, y, z, -x, -y, -z or =X,Y,Z (if not "
                  "given, z, which is checked)")
      ->check([](const std::string& text) {
        return is_direction(text) ? std::string()
                                  : "expected x, y, z, -x, -y, -z or three numbers X,Y,Z";
      });
}

int run(const InventoryOptions& options, CommandContext& context) {
  InventoryRequest request = options.request;
  ConfigTable table;
  describe(table, request.config);
  table.section("tiles", [&] { describe(table, request.tiles); });
  table.section("map", [&] {
    table.add("copc", request.copc,
              "write map.copc.laz as well: the points of map.laz in an octree, for viewers");
  });
  std::vector<std::string> settings = options.settings;
  for (std::string& setting : plot_settings(options.plots, "stand."))
    settings.push_back(std::move(setting));
  if (options.copc) settings.emplace_back("map.copc=true");
  request.config_record.origins = read_settings(table, request.config_file, settings);
  if (options.print_config) {
    std::printf("%s", table.to_yaml(true).c_str());
    return kExitDone;
  }
  if (request.cloud.empty() || request.run_folder.empty()) {
    throw ConfigError({request.cloud.empty()
                           ? "inventory needs a cloud (or run folder) and -o DIR, the folder to "
                             "write (understory inventory --help)"
                           : "inventory needs -o DIR, the folder to write: `understory inventory " +
                                 shell_word(request.cloud) + " -o DIR`"});
  }
  refuse_recording(request.cloud);
  if (request.copc && (request.slice || request.config.extent == InventoryExtent::kBasic))
    throw ConfigError(
        {"--copc writes the points of map.laz, which a cut (--slice) and extent=basic do not make: "
         "leave it out, or measure the whole cloud with extent=full"});
  request.config_record.asked_yaml = table.to_yaml(false);
  return report_outcome(run_inventory(request, context.log, context.until_stopped()));
}

}  // namespace

void add_inventory_command(CLI::App& app, Command& chosen) {
  auto options = std::make_shared<InventoryOptions>();
  CLI::App* command = app.add_subcommand(
      "inventory", "Ground, trees and stem diameters from any point cloud or from a run");
  command->add_option(
      "CLOUD", options->request.cloud,
      "Point cloud (.las, .laz, .e57, .ply, .pcd) in metres, z up; or a run folder");
  command->add_option("-o,--output", options->request.run_folder, "Folder for the results");
  command->add_option("--config", options->request.config_file, "YAML file with settings");
  add_settings_option(*command, options->settings);
  add_cloud_frame_options(*command, options->request.frame);
  command->add_flag("--slice", options->request.slice,
                    "The cloud is one thin cut near breast height: only diameters and places are "
                    "measured, at whatever z it lies");
  add_plot_options(*command, options->plots);
  command->add_flag("--copc", options->copc,
                    "Write map.copc.laz as well: the points of map.laz as Cloud Optimized Point "
                    "Cloud, which QGIS and web viewers show at once");
  command->add_option("--crs", options->request.coordinate_system,
                      "Coordinate system of a cloud that names none, for instance EPSG:3067 (a "
                      "cloud that names its own keeps it)");
  command->add_option_function<std::string>(
      "--max-memory-mb",
      [options](const std::string& mb) {
        options->settings.push_back("tiles.max_memory_mb=" + mb);
      },
      "Memory to take, as tiles.max_memory_mb: a larger cloud is held in tiles on disk");
  command->add_option("--trajectory", options->request.trajectory,
                      "Where the scanner was, in the frame of the cloud: a TUM file. With it and "
                      "beam.sensor, diameters are corrected for the width of the beams (of a run "
                      "it is known)");
  command->add_flag("--print-config", options->print_config, "Print every key and its meaning");
  command->add_flag("--overwrite", options->request.overwrite, kOverwriteMeaning);
  command->footer(
      "Writes trees.csv, stem_curves.csv, dead_wood.csv, trees.gpkg, map.laz, dtm.tif, chm.tif, "
      "dsm.tif,\n"
      "map.qgs, report.html and run.json; with plots also plots.csv and plot_classes.csv, with "
      "--copc "
      "map.copc.laz.\n"
      "Examples:\n  understory inventory plot.laz -o plot-inventory\n"
      "  understory inventory plot.laz --plots 512.5,847.0,9 -o plot-inventory\n"
      "  understory inventory cut.laz --slice -o cut-inventory");
  command->callback([options, &chosen] {
    chosen = [options](CommandContext& context) { return run(*options, context); };
  });
}

}  // namespace understory
