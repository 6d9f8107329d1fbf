#pragma once

#include <cstddef>
#include <filesystem>
#include <map>
#include <string>
#include <vector>

#include "understory/util/progress.h"

namespace understory {

// Layers of GeoPackages that go into a PostGIS database (docs/reference/outputs.md).
struct PostgisRequest {
  std::string target;  // as libpq takes it: "host=... dbname=..." or "postgresql://..."
  std::string schema = "understory";
  std::string run_id;    // rows of the same run are replaced
  std::string run_name;  // for people
  std::string version;   // of the program
  std::vector<std::filesystem::path> packages;
};
struct PostgisOutcome {
  std::string database;                     // "database forest at localhost:5432"
  std::map<std::string, std::size_t> rows;  // by layer
  int srid = 0;                             // 0: no coordinate system
  bool replaced = false;                    // rows of an earlier transfer
};

// The layout of the schema that this program writes. A schema of another one is refused.
inline constexpr int kPostgisLayout = 1;

// Writes all layers in one transaction: either the database holds the whole run, or it is as
// before. Makes PostGIS's extension, the schema and its tables where they are absent. All runs of a
// schema are in one coordinate system. Polls `progress`. Throws InputError where a layer cannot be
// read or its system has no EPSG code. ConfigError: the target is no such text; OutputError: the
// database refuses or goes away.
[[nodiscard]] PostgisOutcome write_postgis(const PostgisRequest& request,
                                           const ProgressSink& progress = {});

}  // namespace understory
