#include "understory/output/database/postgis.h"

#include <fmt/format.h>
#include <ogrsf_frmts.h>

#include <array>
#include <cstdint>
#include <cstdlib>
#include <cstring>
#include <memory>

#include "understory/geometry/quiet_gdal.h"
#include "understory/output/database/pg_connection.h"
#include "understory/util/error.h"

namespace understory {
namespace {

namespace fs = std::filesystem;

// The code of a layer's system as PostGIS knows it; 0 without a system.
int srid_of(const OGRLayer& layer, const fs::path& path) {
  const OGRSpatialReference* system = const_cast<OGRLayer&>(layer).GetSpatialRef();
  if (system == nullptr || system->IsLocal() != 0) return 0;
  for (const char* part : {"PROJCS", "GEOGCS"}) {
    const char* code = system->GetAuthorityCode(part);
    const char* authority = system->GetAuthorityName(part);
    if (code != nullptr && authority != nullptr && std::strcmp(authority, "EPSG") == 0)
      return std::atoi(code);
    if (system->IsProjected() != 0) break;
  }
  throw InputError(path.string(), layer.GetDescription(),
                   "expected a coordinate system with an EPSG code, which PostGIS needs");
}

std::string hex_of(const std::vector<unsigned char>& bytes) {
  constexpr std::array<char, 16> kDigits = {'0', '1', '2', '3', '4', '5', '6', '7',
                                            '8', '9', 'A', 'B', 'C', 'D', 'E', 'F'};
  std::string text;
  for (const unsigned char byte : bytes) {
    text += kDigits[byte >> 4U];
    text += kDigits[byte & 15U];
  }
  return text;
}

// A geometry in PostGIS's extended WKB: little endian, the flag and the number of its system.
std::string ewkb_of(const OGRGeometry& geometry, int srid) {
  std::vector<unsigned char> bytes(geometry.WkbSize());
  geometry.exportToWkb(wkbNDR, bytes.data(), wkbVariantOldOgc);
  if (srid == 0) return hex_of(bytes);
  constexpr std::size_t kTypeEnd = 5;
  bytes[kTypeEnd - 1] |= 0x20U;
  std::array<unsigned char, 4> number{};
  for (std::size_t k = 0; k < number.size(); ++k)
    number[k] = static_cast<unsigned char>((static_cast<std::uint32_t>(srid) >> (8 * k)) & 0xFFU);
  bytes.insert(bytes.begin() + kTypeEnd, number.begin(), number.end());
  return hex_of(bytes);
}

std::string type_of(const OGRFieldDefn& field) {
  switch (field.GetType()) {
    case OFTInteger:
      return "integer";
    case OFTInteger64:
      return "bigint";
    case OFTReal:
      return "double precision";
    default:
      return "text";
  }
}

std::string field_of(const OGRFeature& feature, int k) {
  if (feature.IsFieldSetAndNotNull(k) == 0) return "\\N";
  if (feature.GetFieldDefnRef(k)->GetType() == OFTReal)
    return fmt::format("{}", feature.GetFieldAsDouble(k));
  return copy_field(const_cast<OGRFeature&>(feature).GetFieldAsString(k));
}

// One transfer of a run into a schema.
class Transfer {
 public:
  Transfer(PgConnection& database, const PostgisRequest& request, const ProgressSink& progress)
      : database_(database),
        request_(request),
        progress_(progress),
        schema_(PgConnection::identifier(request.schema)) {}

  // Makes or checks the schema.
  void prepare(int srid) {
    // Two that begin at once make the schema one after the other.
    database_.run("SELECT pg_advisory_xact_lock(hashtext(" +
                  database_.literal("understory " + request_.schema) + "))");
    find_postgis();
    const bool there = !database_
                            .value_of("SELECT 1 FROM pg_namespace WHERE nspname = " +
                                      database_.literal(request_.schema))
                            .empty();
    if (!there) make_schema(srid);
    check_schema(srid);
  }

  // Takes out the rows of an earlier transfer of this run. Whether there were any.
  bool begin_run() {
    const std::string id = database_.literal(request_.run_id);
    const bool replaced =
        database_.count_changed("DELETE FROM " + schema_ + ".runs WHERE run_id = " + id) > 0;
    database_.run("INSERT INTO " + schema_ + ".runs (run_id, name, version) VALUES (" + id + ", " +
                  database_.literal(request_.run_name) + ", " +
                  database_.literal(request_.version) + ")");
    return replaced;
  }

  std::size_t add_layer(OGRLayer& layer, int srid) {
    const std::string table = schema_ + "." + PgConnection::identifier(layer.GetName());
    const std::string columns = make_table(layer, table, srid);
    std::size_t rows = 0;
    const std::string run = copy_field(request_.run_id);
    layer.ResetReading();
    database_.copy("COPY " + table + " (" + columns + ") FROM STDIN", [&]() -> std::string {
      if (rows % 1000 == 0) progress_.poll();
      const std::unique_ptr<OGRFeature> feature(layer.GetNextFeature());
      if (!feature) return {};
      ++rows;
      std::string line = run;
      for (int k = 0; k < feature->GetFieldCount(); ++k)
        line += "\t" + field_of(*feature, k);
      const OGRGeometry* geometry = feature->GetGeometryRef();
      return line + "\t" + (geometry == nullptr ? "\\N" : ewkb_of(*geometry, srid)) + "\n";
    });
    return rows;
  }

 private:
  void find_postgis() {
    constexpr const char* kWhere =
        "SELECT quote_ident(n.nspname) FROM pg_extension e JOIN pg_namespace n ON n.oid = "
        "e.extnamespace WHERE e.extname = 'postgis'";
    std::string where = database_.value_of(kWhere);
    if (where.empty()) {
      if (database_.value_of("SELECT 1 FROM pg_available_extensions WHERE name = 'postgis'")
              .empty())
        throw OutputError(database_.name(),
                          "the server has no PostGIS; expected a database with the extension "
                          "postgis");
      database_.run("CREATE EXTENSION postgis");
      where = database_.value_of(kWhere);
    }
    database_.run("SET LOCAL search_path TO " + where);
    database_.run("SET LOCAL lock_timeout TO '60s'");
  }

  void make_schema(int srid) {
    database_.run("CREATE SCHEMA " + schema_);
    database_.run("CREATE TABLE " + schema_ +
                  ".layout (version integer NOT NULL, srid integer NOT NULL)");
    database_.run(
        fmt::format("INSERT INTO {}.layout VALUES ({}, {})", schema_, kPostgisLayout, srid));
    database_.run("CREATE TABLE " + schema_ +
                  ".runs (run_id text PRIMARY KEY, name text, version text, "
                  "written_at timestamptz NOT NULL DEFAULT now())");
  }

  void check_schema(int srid) {
    const std::string place = database_.name() + ", schema " + request_.schema;
    if (database_.value_of("SELECT to_regclass(" + database_.literal(schema_ + ".layout") + ")")
            .empty())
      throw OutputError(place,
                        "is there, and this program did not make it; choose another by "
                        "--schema");
    const std::string version = database_.value_of("SELECT version FROM " + schema_ + ".layout");
    if (version != std::to_string(kPostgisLayout))
      throw OutputError(place, "has layout " + version + ", and this program writes layout " +
                                   std::to_string(kPostgisLayout) +
                                   "; choose another schema by --schema");
    const std::string held = database_.value_of("SELECT srid FROM " + schema_ + ".layout");
    if (held != std::to_string(srid))
      throw OutputError(place,
                        fmt::format("holds EPSG:{}, and the run is in EPSG:{} (0: no place on "
                                    "the globe); choose another schema by --schema",
                                    held, srid));
  }

  // Makes the table, or the columns that it lacks. The names of the columns, in order.
  std::string make_table(const OGRLayer& layer, const std::string& table, int srid) {
    OGRFeatureDefn* definition = const_cast<OGRLayer&>(layer).GetLayerDefn();
    const OGRwkbGeometryType type = definition->GetGeomType();
    database_.run(fmt::format(
        "CREATE TABLE IF NOT EXISTS {} (run_id text NOT NULL REFERENCES {}.runs ON DELETE CASCADE, "
        "geom geometry({}{}, {}))",
        table, schema_, OGRToOGCGeomType(type), wkbHasZ(type) != 0 ? "Z" : "", srid));
    std::string columns = "run_id";
    for (int k = 0; k < definition->GetFieldCount(); ++k) {
      const OGRFieldDefn& field = *definition->GetFieldDefn(k);
      const std::string name = PgConnection::identifier(field.GetNameRef());
      database_.run("ALTER TABLE " + table + " ADD COLUMN IF NOT EXISTS " + name + " " +
                    type_of(field));
      columns += ", " + name;
    }
    const std::string layer_name = definition->GetName();
    database_.run("CREATE INDEX IF NOT EXISTS " + PgConnection::identifier(layer_name + "_geom") +
                  " ON " + table + " USING gist (geom)");
    database_.run("CREATE INDEX IF NOT EXISTS " + PgConnection::identifier(layer_name + "_run") +
                  " ON " + table + " (run_id)");
    return columns + ", geom";
  }

  PgConnection& database_;
  const PostgisRequest& request_;
  const ProgressSink& progress_;
  std::string schema_;  // quoted
};

GDALDatasetUniquePtr open_package(const fs::path& path) {
  GDALDatasetUniquePtr dataset(GDALDataset::Open(path.c_str(), GDAL_OF_VECTOR | GDAL_OF_READONLY));
  if (dataset == nullptr || dataset->GetLayerCount() == 0)
    throw InputError(path.string(), "", "expected a GeoPackage with layers");
  return dataset;
}

}  // namespace

PostgisOutcome write_postgis(const PostgisRequest& request, const ProgressSink& progress) {
  const QuietGdal quiet;
  std::vector<GDALDatasetUniquePtr> packages;
  PostgisOutcome outcome;
  for (const fs::path& path : request.packages) {
    packages.push_back(open_package(path));
    for (OGRLayer* layer : packages.back()->GetLayers()) {
      const int srid = srid_of(*layer, path);
      if (!outcome.rows.empty() && srid != outcome.srid)
        throw InputError(path.string(), layer->GetName(),
                         "expected the coordinate system of the other layers");
      outcome.srid = srid;
      if (!outcome.rows.emplace(layer->GetName(), 0).second)
        throw InputError(path.string(), layer->GetName(), "expected each layer once");
    }
  }
  PgConnection database(request.target);
  outcome.database = database.name();
  Transfer transfer(database, request, progress);
  transfer.prepare(outcome.srid);
  outcome.replaced = transfer.begin_run();
  for (const GDALDatasetUniquePtr& package : packages)
    for (OGRLayer* layer : package->GetLayers())
      outcome.rows[layer->GetName()] = transfer.add_layer(*layer, outcome.srid);
  database.commit();
  return outcome;
}

}  // namespace understory
