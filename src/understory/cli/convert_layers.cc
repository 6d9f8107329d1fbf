#include "understory/cli/convert_layers.h"

#include <fmt/format.h>

#include <cstdio>
#include <filesystem>
#include <string>

#include "understory/output/database/postgis.h"
#include "understory/output/layers/geojson.h"
#include "understory/output/run_summary.h"
#include "understory/pipeline/run_folder/run_json.h"
#include "understory/util/error.h"
#include "understory/util/files/file_in_folder.h"
#include "understory/util/files/output_guard.h"
#include "understory/util/version.h"

namespace understory {
namespace {

namespace fs = std::filesystem;
constexpr const char* kDatabase = "PG:";

// The run folder of what was given.
fs::path folder_of(const std::string& input) {
  const fs::path given = fs::path(input).lexically_normal();
  if (fs::is_directory(given)) return given.has_filename() ? given : given.parent_path();
  return given.parent_path().empty() ? fs::path(".") : given.parent_path();
}

// The same recordings by the same command are the same run, wherever its folder lies.
std::string run_id_of(const fs::path& folder) {
  const RunJson json(folder);
  std::string hashes;
  for (const std::string& hash : json.find_texts_of("/inputs", "sha256"))
    hashes += hash;
  if (hashes.empty())
    throw InputError((folder / RunJson::kName).string(), "/inputs",
                     "names no input file with its hash, which tells runs apart; expected --run-id "
                     "NAME");
  return json.find_text("/command") + "-" + hash_text(hashes).substr(0, 16);
}

int convert_to_database(const LayerConversion& conversion, CommandContext& context) {
  if (conversion.target.rfind(kDatabase, 0) != 0)
    throw ConfigError({"--to " + conversion.target + ": expected PG:host=... dbname=..."});
  if (conversion.schema.empty()) throw ConfigError({"--schema is empty"});
  const fs::path folder = folder_of(conversion.input);
  PostgisRequest request;
  request.target = conversion.target.substr(std::string(kDatabase).size());
  request.schema = conversion.schema;
  request.packages = {file_in_folder(conversion.input, "trees.gpkg")};
  request.run_id = conversion.run_id.empty() ? run_id_of(folder) : conversion.run_id;
  request.run_name = fs::weakly_canonical(folder).filename().string();
  request.version = kVersion;
  const PostgisOutcome outcome = write_postgis(request, context.until_stopped());
  std::string rows;
  for (const auto& [layer, count] : outcome.rows)
    rows += fmt::format("{}{} {}", rows.empty() ? "" : ", ", count, layer);
  fmt::print("{} in {}, schema {}, {}; run {}{}\n", rows, outcome.database, conversion.schema,
             outcome.srid == 0 ? "no coordinate system" : fmt::format("EPSG:{}", outcome.srid),
             request.run_id, outcome.replaced ? ", which replaces its former rows" : "");
  return kExitDone;
}

}  // namespace

bool is_layer_output(const std::string& output) {
  return fs::path(output).extension() == ".geojson";
}

int convert_layers(const LayerConversion& conversion, CommandContext& context) {
  if (!conversion.target.empty()) return convert_to_database(conversion, context);
  const fs::path package = file_in_folder(conversion.input, "trees.gpkg");
  refuse_input_as_output(conversion.output, {package});
  const fs::path output = place_of_file(conversion.output, conversion.overwrite);
  const std::size_t rows = write_geojson(package, conversion.layer, output);
  fmt::print("{} {} in {}\n", rows, conversion.layer, conversion.output);
  return kExitDone;
}

}  // namespace understory
