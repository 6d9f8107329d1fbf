#include "understory/output/layers/qgis_project.h"

#include <fmt/format.h>
#include <gdal_priv.h>
#include <ogrsf_frmts.h>

#include <algorithm>
#include <utility>

#include "understory/geometry/quiet_gdal.h"
#include "understory/output/report/svg_plot.h"
#include "understory/util/files/atomic_file.h"

namespace understory {
namespace {

// One layer of the project.
struct Layer {
  std::string id;
  std::string name;
  std::string source;    // relative to the project
  std::string provider;  // of QGIS
  std::string attributes;
  std::string style;
  bool shown = true;
};

std::string system_xml(const QgisProject& project) {
  std::string id = project.crs_code;
  if (id.find('+') != std::string::npos || id.find(':') == std::string::npos) id.clear();
  const std::string number = id.empty() ? "0" : id.substr(id.find(':') + 1);
  return fmt::format(
      "<spatialrefsys nativeFormat=\"Wkt\"><wkt>{}</wkt><srid>{}</srid><authid>{}</authid>"
      "</spatialrefsys>",
      escape_html(project.crs_wkt), number, escape_html(id));
}

// A symbol in the words of QGIS: options since 3.26, props before.
std::string symbol_xml(const char* type, const char* kind,
                       const std::vector<std::array<const char*, 2>>& options) {
  std::string map;
  std::string props;
  for (const auto& [key, value] : options) {
    map += fmt::format("<Option type=\"QString\" name=\"{}\" value=\"{}\"/>", key, value);
    props += fmt::format("<prop k=\"{}\" v=\"{}\"/>", key, value);
  }
  return fmt::format(
      "<renderer-v2 type=\"singleSymbol\" symbollevels=\"0\" enableorderby=\"0\" "
      "forceraster=\"0\"><symbols><symbol type=\"{}\" name=\"0\" alpha=\"1\" "
      "clip_to_extent=\"1\" force_rhr=\"0\"><layer class=\"{}\" enabled=\"1\" locked=\"0\" "
      "pass=\"0\"><Option type=\"Map\">{}</Option>{}</layer></symbol></symbols></renderer-v2>",
      type, kind, map, props);
}

bool holds(const std::vector<std::string>& names, const char* name) {
  return std::find(names.begin(), names.end(), name) != names.end();
}

// The layers of trees.gpkg, the topmost first.
std::vector<Layer> vector_layers() {
  const auto layer = [](const char* id, const char* name, const char* geometry,
                        const std::string& style) {
    return Layer{id,
                 name,
                 fmt::format("./trees.gpkg|layername={}", id),
                 "ogr",
                 fmt::format("type=\"vector\" geometry=\"{}\"", geometry),
                 style,
                 true};
  };
  return {layer("look_again", "places to look from again", "Point",
                symbol_xml("marker", "SimpleMarker",
                           {{"color", "22,160,133,255"},
                            {"name", "triangle"},
                            {"outline_color", "255,255,255,255"},
                            {"outline_width", "0.3"},
                            {"size", "4"}})),
          layer("trees", "trees", "Point",
                symbol_xml("marker", "SimpleMarker",
                           {{"color", "255,242,194,255"},
                            {"name", "circle"},
                            {"outline_color", "192,57,43,255"},
                            {"outline_width", "0.4"},
                            {"size", "2"}})),
          layer("stumps", "stumps", "Point",
                symbol_xml("marker", "SimpleMarker",
                           {{"color", "160,110,60,255"},
                            {"name", "square"},
                            {"outline_color", "90,60,30,255"},
                            {"outline_width", "0.3"},
                            {"size", "2"}})),
          layer("logs", "lying stems", "Line",
                symbol_xml("line", "SimpleLine",
                           {{"line_color", "160,110,60,255"}, {"line_width", "1"}})),
          layer("crowns", "crowns seen from above", "Polygon",
                symbol_xml("fill", "SimpleFill",
                           {{"color", "46,139,87,40"},
                            {"outline_color", "46,139,87,255"},
                            {"outline_width", "0.3"},
                            {"style", "solid"}})),
          layer("path", "path of the scanner", "Line",
                symbol_xml("line", "SimpleLine",
                           {{"line_color", "37,99,200,255"}, {"line_width", "0.5"}})),
          layer("plots", "sample plots", "Polygon",
                symbol_xml("fill", "SimpleFill",
                           {{"color", "0,0,0,0"},
                            {"outline_color", "120,60,160,255"},
                            {"outline_width", "0.6"},
                            {"style", "no"}}))};
}

std::vector<Layer> layers_of(const std::vector<std::string>& vectors,
                             const std::vector<std::string>& files) {
  const auto there = [&](const char* name) { return holds(files, name); };
  std::vector<Layer> layers;
  if (there("trees.gpkg")) {
    for (Layer& layer : vector_layers())
      if (holds(vectors, layer.id.c_str())) layers.push_back(std::move(layer));
  }
  if (there("chm.tif"))
    layers.push_back({"chm", "height of the canopy", "./chm.tif", "gdal", "type=\"raster\"", ""});
  if (there("dsm.tif"))
    layers.push_back({"dsm", "height of the surface", "./dsm.tif", "gdal", "type=\"raster\"", ""});
  if (there("dtm.tif"))
    layers.push_back({"dtm", "height of the ground", "./dtm.tif", "gdal", "type=\"raster\"", ""});
  if (there("free_height.tif"))
    layers.push_back({"free_height", "free height below obstacles", "./free_height.tif", "gdal",
                      "type=\"raster\"", "", false});
  if (there("obstacles.laz"))
    layers.push_back({"obstacles", "obstacles along the path", "./obstacles.laz", "pdal",
                      "type=\"point-cloud\"", "", false});
  // QGIS builds an index beside map.laz before it shows it.
  if (there("map.copc.laz")) {
    layers.push_back(
        {"cloud", "points", "./map.copc.laz", "copc", "type=\"point-cloud\"", "", false});
  } else if (there("map.laz")) {
    layers.push_back({"cloud", "points", "./map.laz", "pdal", "type=\"point-cloud\"", "", false});
  }
  return layers;
}

std::string layer_xml(const Layer& layer, const std::string& system) {
  return fmt::format(
      "<maplayer {} autoRefreshEnabled=\"0\" hasScaleBasedVisibilityFlag=\"0\"><id>{}</id>"
      "<datasource>{}</datasource><layername>{}</layername><srs>{}</srs>"
      "<provider encoding=\"UTF-8\">{}</provider>{}</maplayer>\n",
      layer.attributes, layer.id, escape_html(layer.source), escape_html(layer.name), system,
      layer.provider, layer.style);
}

std::string extent_xml(const std::array<double, 4>& extent) {
  if (!(extent[2] > extent[0]) || !(extent[3] > extent[1])) return "";
  return fmt::format(
      "<extent><xmin>{:.9g}</xmin><ymin>{:.9g}</ymin><xmax>{:.9g}</xmax><ymax>{:.9g}</ymax>"
      "</extent>",
      extent[0], extent[1], extent[2], extent[3]);
}

// Names of the layers of a GeoPackage; none where it is not there.
std::vector<std::string> vectors_in(const std::filesystem::path& file) {
  const QuietGdal quiet;
  std::vector<std::string> names;
  if (!std::filesystem::exists(file)) return names;
  const GDALDatasetUniquePtr dataset(
      GDALDataset::Open(file.c_str(), GDAL_OF_VECTOR | GDAL_OF_READONLY));
  for (int i = 0; dataset != nullptr && i < dataset->GetLayerCount(); ++i)
    names.emplace_back(dataset->GetLayer(i)->GetName());
  return names;
}

}  // namespace

std::string qgis_project_xml(const QgisProject& project, const std::vector<std::string>& vectors,
                             const std::vector<std::string>& files) {
  const std::string system = system_xml(project);
  const std::vector<Layer> layers = layers_of(vectors, files);
  std::string tree;
  std::string order;
  std::string maps;
  for (const Layer& layer : layers) {
    tree += fmt::format(
        "<layer-tree-layer id=\"{}\" name=\"{}\" checked=\"{}\" expanded=\"0\" "
        "providerKey=\"{}\" source=\"{}\"/>\n",
        layer.id, escape_html(layer.name), layer.shown ? "Qt::Checked" : "Qt::Unchecked",
        layer.provider, escape_html(layer.source));
    order += fmt::format("<layer id=\"{}\"/>", layer.id);
    maps += layer_xml(layer, system);
  }
  return fmt::format(
      "<!DOCTYPE qgis PUBLIC 'http://mrcc.com/qgis.dtd' 'SYSTEM'>\n"
      "<qgis projectname=\"{0}\" version=\"3.22.0\">\n<title>{0}</title>\n"
      "<projectCrs>{1}</projectCrs>\n<layer-tree-group>\n{2}</layer-tree-group>\n"
      "<mapcanvas name=\"theMapCanvas\" annotationsVisible=\"1\"><units>{3}</units>{4}"
      "<rotation>0</rotation><destinationsrs>{1}</destinationsrs></mapcanvas>\n"
      "<layerorder>{5}</layerorder>\n<projectlayers>\n{6}</projectlayers>\n"
      "<properties><Paths><Absolute type=\"bool\">false</Absolute></Paths><SpatialRefSys>"
      "<ProjectionsEnabled type=\"int\">{7}</ProjectionsEnabled></SpatialRefSys></properties>\n"
      "</qgis>\n",
      escape_html(project.title), system, tree,
      project.crs_wkt.rfind("GEOG", 0) == 0 ? "degrees" : "meters", extent_xml(project.extent),
      order, maps, project.crs_wkt.empty() ? 0 : 1);
}

void write_qgis_project(const std::filesystem::path& folder, const QgisProject& project) {
  std::vector<std::string> files;
  for (const char* name : {"trees.gpkg", "chm.tif", "dsm.tif", "dtm.tif", "free_height.tif",
                           "obstacles.laz", "map.laz", "map.copc.laz"}) {
    if (std::filesystem::exists(folder / name)) files.emplace_back(name);
  }
  AtomicFile file(folder / "map.qgs");
  file.write(qgis_project_xml(project, vectors_in(folder / "trees.gpkg"), files));
  file.commit();
}

}  // namespace understory
