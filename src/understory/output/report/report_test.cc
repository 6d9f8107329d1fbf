#include "understory/output/report/report.h"

#include <fmt/format.h>
#include <gtest/gtest.h>

#include <string>

#include "understory/output/report/report_parts.h"
#include "understory/output/report/test_count.h"

namespace understory {
namespace {

using test::count_of;

ReportInput run_with_loops(int closed, int rejected, std::size_t not_listed) {
  ReportInput input;
  input.scans.resize(3);
  input.loops_not_listed = not_listed;
  for (int k = 0; k < closed + rejected; ++k) {
    ReportLoop loop;
    loop.accepted = k < closed;
    input.loops.push_back(loop);
  }
  return input;
}

// "24 of 24 tried loops" stood over a run with 252 candidates that were not accepted.
TEST(Report, CountsOfLoopsAreThoseOfTheTable) {
  const std::string html = report_html(run_with_loops(24, 3, 252));
  EXPECT_NE(html.find("279 views look like an earlier place"), std::string::npos);
  EXPECT_NE(html.find("confirmed 27 of them"), std::string::npos);
  EXPECT_NE(html.find("24 closed, 3 rejected"), std::string::npos);
  EXPECT_NE(html.find("The other 252"), std::string::npos);
  EXPECT_EQ(count_of(html, "<td>closed</td>"), 24U);
  EXPECT_EQ(count_of(html, "<td>rejected</td>"), 3U);
  EXPECT_EQ(count_of(html, "tried loops"), 0U);
}

TEST(Report, EveryLoopThatWasTriedIsInTheTable) {
  const std::string html = report_html(run_with_loops(2, 5, 0));
  EXPECT_NE(html.find("7 loops were tried (the table below): 2 closed, 5 rejected"),
            std::string::npos);
  EXPECT_EQ(count_of(html, "<td>closed</td>") + count_of(html, "<td>rejected</td>"), 7U);
  const std::string many = report_html(run_with_loops(30, 60, 0));
  EXPECT_NE(many.find("The first 40 of 90 are shown."), std::string::npos);
}

// "start" and "end" were drawn on each other where a way ends near its start.
TEST(Report, LabelsOfAWayThatEndsNearItsStartStandApart) {
  ReportInput input;
  input.scans.resize(3);
  input.scans[1].position = {50.0F, 30.0F, 0.0F};
  const auto left_labels = [&](const Eigen::Vector3f& end) {
    input.scans[2].position = end;
    const std::string html = report_html(input);
    EXPECT_NE(html.find(">start</text>"), std::string::npos);
    return count_of(html, "font-weight=\"600\" text-anchor=\"end\"");
  };
  EXPECT_EQ(left_labels({0.5F, 0.0F, 0.0F}), 1U);
  EXPECT_EQ(left_labels({-0.5F, 0.0F, 0.0F}), 1U);
  EXPECT_EQ(left_labels({40.0F, 0.0F, 0.0F}), 0U);
}

// A user looks for the trees first; the table names what lies there, and no file of others.
TEST(Report, ListsTheFilesThatLieBesideIt) {
  const std::string html = report_html(ReportInput(), {"run.json", "notes.txt", "trees.csv"});
  const std::size_t trees = html.find("<code>trees.csv</code>");
  const std::size_t run = html.find("<code>run.json</code>");
  ASSERT_NE(trees, std::string::npos);
  ASSERT_NE(run, std::string::npos);
  EXPECT_LT(trees, run);
  EXPECT_EQ(html.find("notes.txt"), std::string::npos);
  EXPECT_EQ(html.find("<code>map.laz</code>"), std::string::npos);
  EXPECT_EQ(report_html(ReportInput()).find("The files of this folder"), std::string::npos);
}

// Of a full inventory: the volume of the stems whose height is known, on the area of the stand.
TEST(Report, AFullInventoryHasTheStemVolumePerHectare) {
  InventoryResult inventory;
  inventory.area_m2 = 2'000.0;
  inventory.trees.resize(3);
  inventory.stems.resize(3);
  for (Tree& tree : inventory.trees)
    tree.dbh_m = 0.2;
  ReportInput input;
  input.inventory = &inventory;
  EXPECT_EQ(report_html(input).find("m³"), std::string::npos);
  inventory.trees[0].stem_volume_m3 = 5.5;
  inventory.trees[1].stem_volume_m3 = 4.25;
  inventory.trees[1].crown_area_m2 = 12.3;
  const std::string html = report_html(input);
  EXPECT_NE(html.find("≈ 49 m³/ha"), std::string::npos);
  EXPECT_NE(html.find("Volume of the 2 stems"), std::string::npos);
  EXPECT_NE(html.find("<td class=\"n\">4.250</td>"), std::string::npos);
  EXPECT_NE(html.find("<td class=\"n\">12.3</td>"), std::string::npos);
}

// Trees by their crowns come after those with stems, and have no figures of a stem.
TEST(Report, TreesByTheirCrownsStandInTheTableWithoutAStem) {
  InventoryResult inventory;
  inventory.area_m2 = 1'000.0;
  inventory.trees.resize(2);
  inventory.stems.resize(1);
  inventory.stems[0].arc_deg = 123.0;
  inventory.trees[0].dbh_m = 0.25;
  inventory.trees[1].height_m = 18.4;
  inventory.trees[1].crown_area_m2 = 9.5;
  ReportInput input;
  input.inventory = &inventory;
  const std::string both = report_html(input);
  EXPECT_EQ(count_of(both, "<td class=\"n\">123</td>"), 1U);
  EXPECT_NE(both.find("<td class=\"n\">18.4</td>"), std::string::npos);
  EXPECT_NE(both.find("trees found by their crowns"), std::string::npos);
  EXPECT_NE(both.find("25.0 cm"), std::string::npos) << "the mean of the one diameter";
  inventory.trees.erase(inventory.trees.begin());
  inventory.stems.clear();
  const std::string crowns = report_html(input);
  EXPECT_EQ(crowns.find("seen around"), std::string::npos);
  EXPECT_EQ(crowns.find("diameter, cm"), std::string::npos);
  EXPECT_NE(crowns.find("height above the ground, m"), std::string::npos);
}

Tree tree_at_origin(int id, double dbh_m, double dbh_sd_m, double height_m) {
  Tree tree;
  tree.id = id;
  tree.dbh_m = dbh_m;
  tree.dbh_sd_m = dbh_sd_m;
  tree.height_m = height_m;
  return tree;
}

// The scripts of the page read the trees from the picture: place, true radius, how sure it is.
TEST(Report, TheMapTellsWhichTreesAreDoubtful) {
  constexpr double kUnknown = Tree::kUnknown;
  InventoryResult inventory;
  inventory.trees = {tree_at_origin(1, 0.2, 0.01, 12.0), tree_at_origin(2, 0.2, 0.07, kUnknown),
                     tree_at_origin(3, kUnknown, kUnknown, 18.0)};
  inventory.trees[0].x = 40.0;
  inventory.stems.resize(2);
  ReportInput input;
  input.inventory = &inventory;
  const std::string html = report_html(input);
  EXPECT_NE(html.find("<circle class=\"sure\" data-id=\"1\""), std::string::npos);
  EXPECT_NE(html.find("<circle class=\"weak\" data-id=\"2\""), std::string::npos);
  EXPECT_NE(html.find("<circle class=\"crown\" data-id=\"3\""), std::string::npos);
  EXPECT_NE(html.find("tree 1: 20.0 ± 1.0 cm, 12.0 m high"), std::string::npos);
  EXPECT_NE(html.find("tree 2: 20.0 ± 7.0 cm<"), std::string::npos);
  EXPECT_NE(html.find("tree 3: no diameter, 18.0 m high"), std::string::npos);
  // 40 m and a margin of 2 % on each side are 1,100 units; the first stem has a radius of 10 cm.
  const std::size_t at = html.find("data-metre=\"");
  ASSERT_NE(at, std::string::npos);
  const double per_metre = std::stod(html.substr(at + 12));
  EXPECT_NEAR(per_metre, 1100.0 / 41.6, 1e-3);
  EXPECT_NE(html.find(fmt::format("data-r=\"{:.2f}\"", 0.1 * per_metre)), std::string::npos);
}

// Three bytes a point of the side, two a point of the cross section; the most doubtful tree first.
TEST(Report, SheetsHoldThePointsOfTheTreesMostDoubtfulFirst) {
  InventoryResult inventory;
  inventory.trees = {tree_at_origin(1, 0.2, 0.01, 12.0), tree_at_origin(2, 0.3, 0.2, 9.0)};
  inventory.stems.resize(2);
  for (StemFit& stem : inventory.stems) {
    stem.radius_m = 0.1;
    stem.arc_deg = 90.0;
  }
  inventory.sheets.resize(2);
  for (std::size_t i = 0; i < 2; ++i) {
    TreeSheet& sheet = inventory.sheets[i];
    sheet.tree = i;
    sheet.section_reach_m = 0.3;
    sheet.seen.set(3);
    // East 1 cube and a half, height 10 cubes and a half, on the stem.
    sheet.front.push_back({{0.06F, 0.0F, 0.42F}, true, true});
    sheet.section.emplace_back(0.3F, -0.3F);
  }
  ReportInput input;
  input.inventory = &inventory;
  const std::string html = report_html(input);
  const std::size_t first = html.find("\n2,30.0,20.0,9.0,90,0.3000,");
  const std::size_t at = html.find("class=\"sheet-data\">2,30.0,20.0,9.0,90,0.3000,");
  EXPECT_EQ(first, std::string::npos) << "it begins the data";
  ASSERT_NE(at, std::string::npos);
  const std::size_t second = html.find("\n1,20.0,1.0,12.0,90,0.3000,", at);
  ASSERT_NE(second, std::string::npos);
  const std::string line = html.substr(second + 1, html.find('\n', second + 1) - second - 1);
  // 129, 10 and 0x80: gQqA; 255 and 1: /wE=
  EXPECT_NE(line.find(",8,"), std::string::npos) << line;
  EXPECT_EQ(line.substr(line.size() - 10), ",gQqA,/wE=") << line;
}

TEST(Report, PlacesToWalkToAreOnTheMapAndInWords) {
  InventoryResult inventory;
  inventory.trees = {tree_at_origin(1, 0.2, 0.1, 12.0), tree_at_origin(2, 0.3, 0.2, 9.0)};
  inventory.trees[1].x = 10.0;
  inventory.stems.resize(2);
  inventory.look_again.resize(1);
  inventory.look_again[0].place = {5.0, 1.0, 0.0};
  inventory.look_again[0].trees = {2, 1};
  inventory.look_again[0].unseen_sides = 2;
  inventory.thin = {4.0, {{0.0, 0.0}, {4.0, 0.0}, {12.0, 0.0}}, 0.5};
  ReportInput input;
  input.inventory = &inventory;
  input.summary.notes = {"2 of 2 <diameters> are doubtful"};
  const std::string html = report_html(input);
  EXPECT_NE(html.find("<li>x 5.0, y 1.0: trees 2, 1 (unseen side)</li>"), std::string::npos);
  EXPECT_EQ(count_of(html, "<g class=\"stand\""), 1U);
  EXPECT_NE(html.find("<li>2 of 2 &lt;diameters&gt; are doubtful</li>"), std::string::npos);
  // Two neighbours are one rectangle.
  const std::size_t thin = html.find("class=\"thin-area\"");
  ASSERT_NE(thin, std::string::npos);
  EXPECT_EQ(count_of(html.substr(thin, html.find("/>", thin) - thin), "z"), 2U);
}

// "distance 20 cm; less is better" was taken for the error of the map.
TEST(Report, TellsWhatTheDistanceOfMatchedPointsIs) {
  ReportInput input;
  input.scans.resize(2);
  for (ReportScan& scan : input.scans)
    scan.fitness_m2 = 0.04F;
  input.map_cell_m = 0.5;
  EXPECT_NE(report_html(input).find("mean place for each cube of 50 cm"), std::string::npos);
  EXPECT_NE(report_html(input).find("Usual are 16 to 23 cm"), std::string::npos);
  input.map_cell_m = 0.0;
  EXPECT_NE(report_html(input).find("from the nearest surface of the map"), std::string::npos);
  EXPECT_EQ(report_html(input).find("for each cube"), std::string::npos);
}

// "... to tell the heading The layers are in a local frame" was one sentence.
TEST(Report, AWarningEndsBeforeItsConsequenceBegins) {
  ReportInput input;
  Log log;
  log.warn("gnss.not_placed", "expected 5 m at least");
  log.warn("imu.silent", "It was silent.");
  input.summary.warnings = log.warnings();
  const std::string html = report_html(input);
  EXPECT_NE(html.find("5 m at least. <span class=\"so\">The layers are"), std::string::npos);
  EXPECT_NE(html.find("It was silent. <span class=\"so\">In such gaps"), std::string::npos);
}

// A map whose northing lines lie near its top wrote "N" over "E" in the upper left corner.
TEST(Report, NumbersOfTheGridStandApart) {
  const GeodeticPlace place{61.2, 25.1, 150.0};
  const LayerFrame frame(Pose(), place, "EPSG:32635");
  ReportInput input;
  input.scans.resize(2);
  input.drawing = &frame;
  input.north_is_up = true;
  std::size_t lines = 0;
  for (float north = 40.0F; north < 60.0F; north += 1.0F) {
    input.scans[1].position = {95.0F, north, 0.0F};
    const std::string html = report_html(input);
    const std::string norths = "<text x=\"4\" y=\"";
    for (std::size_t at = html.find(norths); at != std::string::npos;
         at = html.find(norths, at + 1)) {
      ++lines;
      EXPECT_GE(std::stod(html.substr(at + norths.size())), 34.0) << north;
    }
  }
  EXPECT_GT(lines, 20U);
}

// "known to 0.0 degrees ... that is 0.0 m on the ground" told nothing.
TEST(Report, AHeadingThatIsExactIsNotDistrusted) {
  ReportInput input = run_with_loops(1, 0, 0);
  input.summary.place.emplace();
  input.summary.place->on_globe = true;
  input.summary.place->heading_sd_deg = 0.02;
  EXPECT_EQ(distrust_section(input).find("The heading of the map"), std::string::npos);
  input.summary.place->heading_sd_deg = 0.2;
  EXPECT_NE(distrust_section(input).find("0.2 m on the ground"), std::string::npos);
}

// A run by stems has neither a cloud nor rasters.
TEST(Report, NamesTheLayersThatAreThere) {
  ReportInput input;
  input.summary.place.emplace();
  input.summary.place->on_globe = true;
  const std::string all = place_section(input, {"map.laz", "dtm.tif", "trees.gpkg", "trees.csv"});
  EXPECT_NE(all.find("system: map.laz, the rasters and trees.gpkg."), std::string::npos);
  EXPECT_EQ(place_section(input, {"trees.gpkg"}).find("map.laz"), std::string::npos);
}

// "found by the method: split" was not understood.
TEST(Report, SaysInWordsWhatPlacedTheMap) {
  ReportInput input;
  input.summary.place.emplace();
  input.summary.place->on_globe = true;
  input.summary.place->method = "fit3+trees";
  const std::string html = place_section(input, {});
  EXPECT_NE(html.find("each as exact as it states (method fit3); the trees of"), std::string::npos);
  EXPECT_NE(html.find("(method trees)"), std::string::npos);
}

// The height curve and the form factor are not known again, and what they filled in is.
TEST(Report, AMovedRunTellsWhatWasFilledIn) {
  const std::vector<Tree> trees = {tree_at_origin(1, 0.2, 0.01, 12.0)};
  StandTable stand;
  stand.seen.trees = 91;
  stand.seen.seen_m2 = 1190.0;
  stand.seen.stems_per_ha = {764.0, 8.0};
  stand.seen.heights_filled_in = 19;
  stand.seen.volumes_filled_in = 19;
  ReportInput input;
  input.moved = input.trees_of_cloud = true;
  input.trees = &trees;
  input.area_m2 = 7548.0;
  input.stand = &stand;
  const std::string html = report_html(input);
  EXPECT_NE(html.find("764 ± 8"), std::string::npos);
  EXPECT_EQ(html.find("stems per hectare seen"), std::string::npos);
  EXPECT_NE(html.find("The tops of 19 of these 91 trees were not seen, or not surely."),
            std::string::npos);
  EXPECT_EQ(html.find(" nan"), std::string::npos);
}

// Every figure at the top is explained below it.
TEST(Report, EachFigureHasItsMeaning) {
  const std::string html = report_html(run_with_loops(1, 0, 0));
  EXPECT_GT(count_of(html, "<div class=\"tile\">"), 3U);
  EXPECT_EQ(count_of(html, "<div class=\"tile\">"), count_of(html, "<dt>"));
  EXPECT_EQ(count_of(html, "<dd></dd>"), 0U);
}

}  // namespace
}  // namespace understory
