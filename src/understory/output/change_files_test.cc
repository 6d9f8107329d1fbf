#include "understory/output/change_files.h"

#include <gdal_priv.h>
#include <gtest/gtest.h>
#include <ogrsf_frmts.h>

#include <fstream>
#include <sstream>

#include "understory/util/files/folder_test_support.h"

namespace understory {
namespace {

TEST(ChangeFiles, RowsTellWhatTheyKnowAndNoMore) {
  std::vector<Tree> before(2);
  before[0].id = 7;
  before[0].x = 1.0;
  before[0].dbh_m = 0.2;
  before[1].id = 8;
  before[1].x = 5.0;
  std::vector<Tree> after(1);
  after[0].id = 3;
  after[0].x = 1.1;
  after[0].dbh_m = 0.25;
  TreeChanges changes;
  changes.trees.resize(2);
  changes.trees[0].in_old = 0;
  changes.trees[0].in_new = 0;
  changes.trees[0].dbh_m = {0.05, 0.01, true};
  changes.trees[1].in_old = 1;
  changes.trees[1].fate = TreeFate::kGone;
  const PointTable table = changes_table(before, after, changes);
  const test::TemporaryFolder folder;
  write_changes(folder / "changes.csv", table, {});
  std::ifstream file(folder / "changes.csv");
  std::stringstream text;
  text << file.rdbuf();
  EXPECT_EQ(text.str(),
            "x,y,z,change,id_old,id_new,apart_m,"
            "dbh_old_m,dbh_new_m,dbh_increment_m,dbh_increment_sd_m,dbh_significant,"
            "height_old_m,height_new_m,height_increment_m,height_increment_sd_m,"
            "height_significant,stem_volume_old_m3,stem_volume_new_m3,"
            "stem_volume_increment_m3,stem_volume_increment_sd_m3,stem_volume_significant\n"
            "1.100,0.000,0.000,stays,7,3,0.100,0.2000,0.2500,0.0500,0.0100,1,,,,,,,,,,\n"
            "5.000,0.000,0.000,gone,8,,,,,,,,,,,,,,,,,\n");
  // In a frame that is shifted by 100 m.
  write_changes(folder / "changes.gpkg", table,
                LayerFrame(Pose(Eigen::Quaterniond::Identity(), {100.0, 0.0, 0.0})));
  const GDALDatasetUniquePtr dataset(
      GDALDataset::Open((folder / "changes.gpkg").c_str(), GDAL_OF_VECTOR));
  OGRLayer* layer = dataset->GetLayerByName("changes");
  ASSERT_NE(layer, nullptr);
  ASSERT_EQ(layer->GetFeatureCount(), 2);
  const std::unique_ptr<OGRFeature> first(layer->GetNextFeature());
  EXPECT_NEAR(first->GetGeometryRef()->toPoint()->getX(), 101.1, 1e-9);
  EXPECT_STREQ(first->GetFieldAsString("change"), "stays");
  EXPECT_EQ(first->GetFieldAsInteger("dbh_significant"), 1);
  const std::unique_ptr<OGRFeature> second(layer->GetNextFeature());
  EXPECT_FALSE(second->IsFieldSetAndNotNull(second->GetFieldIndex("id_new")));
  EXPECT_FALSE(second->IsFieldSetAndNotNull(second->GetFieldIndex("dbh_increment_m")));
}

}  // namespace
}  // namespace understory
