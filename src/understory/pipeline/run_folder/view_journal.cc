#include "understory/pipeline/run_folder/view_journal.h"

#include <utility>

#include "understory/geometry/pose_io.h"
#include "understory/sensor/sensor_io.h"

namespace understory {
namespace {

enum class Kind : std::uint8_t { kPose = 1, kView = 2, kFix = 3 };

void put_step(BinaryWriter& writer, const SparseStep& step) {
  writer.put(step.status);
  put_pose(writer, step.world_from_body);
  put_pose(writer, step.previous_from_body);
  writer.put_doubles(step.covariance.data(), 36);
  for (const double number :
       {step.overlap, step.error_m, step.spacing_m, step.up.spread_rad, step.up.sd_rad,
        step.up.up_in_body.x(), step.up.up_in_body.y(), step.up.up_in_body.z()})
    writer.put(number);
  writer.put(step.up.stems);
}

SparseStep get_step(BinaryReader& reader) {
  SparseStep step;
  step.status = reader.get_enum(SparseStepStatus::kUnmatched);
  step.world_from_body = get_pose(reader);
  step.previous_from_body = get_pose(reader);
  reader.get_doubles(step.covariance.data(), 36);
  for (double* number :
       {&step.overlap, &step.error_m, &step.spacing_m, &step.up.spread_rad, &step.up.sd_rad,
        &step.up.up_in_body.x(), &step.up.up_in_body.y(), &step.up.up_in_body.z()})
    *number = reader.get<double>();
  step.up.stems = reader.get<int>();
  return step;
}

void put_stem(BinaryWriter& writer, const Stem& stem) {
  for (int i = 0; i < 3; ++i)
    writer.put(stem.point[i]);
  for (int i = 0; i < 3; ++i)
    writer.put(stem.axis[i]);
  for (const float number : {stem.length_m, stem.dbh_m, stem.score, stem.radius_m, stem.radius_sd_m,
                             stem.xx, stem.xy, stem.yy, stem.zz})
    writer.put(number);
}

Stem get_stem(BinaryReader& reader) {
  Stem stem;
  for (int i = 0; i < 3; ++i)
    stem.point[i] = reader.get<float>();
  for (int i = 0; i < 3; ++i)
    stem.axis[i] = reader.get<float>();
  for (float* number : {&stem.length_m, &stem.dbh_m, &stem.score, &stem.radius_m, &stem.radius_sd_m,
                        &stem.xx, &stem.xy, &stem.yy, &stem.zz})
    *number = reader.get<float>();
  return stem;
}

void get_view(BinaryReader& reader, ViewSink& sink) {
  StemView view;
  view.frame = reader.get<int>();
  view.stamp = reader.get<TimeNs>();
  const SparseStep step = get_step(reader);
  for (auto left = reader.get<std::uint64_t>(); left > 0; --left)
    view.stems.push_back(get_stem(reader));
  sink.on_view(view, step);
}

void get_record(BinaryReader& reader, const std::string& file, ViewSink& sink) {
  const auto kind = reader.get_enum(Kind::kFix);
  if (kind == Kind::kPose) {
    const bool positioned = reader.get<bool>();
    sink.on_pose(get_stamped_pose(reader), positioned);
  } else if (kind == Kind::kView) {
    get_view(reader, sink);
  } else if (kind == Kind::kFix) {
    sink.on_fix(get_fix(reader));
  } else {
    throw InputError(file, "", "expected a pose, a view or a fix");
  }
}

}  // namespace

ViewJournal::ViewJournal(std::filesystem::path path) : file_(std::move(path)) {}

ViewJournal::ViewJournal(std::filesystem::path path, const RecordCount& known, ViewSink& sink)
    : file_(std::move(path), known) {
  replay(sink);
}

void ViewJournal::replay(ViewSink& sink) const {
  const std::string file = file_.path().string();
  file_.for_each([&](std::uint64_t /*offset*/, RecordFile::Bytes bytes) {
    BinaryReader reader({bytes.begin(), bytes.end()}, file);
    get_record(reader, file, sink);
  });
}

void ViewJournal::on_pose(const StampedPose& pose, bool positioned) {
  BinaryWriter record;
  record.put(Kind::kPose);
  record.put(positioned);
  put_stamped_pose(record, pose);
  append(record);
}

void ViewJournal::on_view(const StemView& view, const SparseStep& step) {
  BinaryWriter record;
  record.put(Kind::kView);
  record.put(view.frame);
  record.put(view.stamp);
  put_step(record, step);
  record.put(static_cast<std::uint64_t>(view.stems.size()));
  for (const Stem& stem : view.stems)
    put_stem(record, stem);
  append(record);
}

void ViewJournal::on_fix(const GnssFix& fix) {
  BinaryWriter record;
  record.put(Kind::kFix);
  put_fix(record, fix);
  append(record);
}

void ViewJournal::append(const BinaryWriter& record) {
  file_.append({bytes_of(record.bytes())});
}

}  // namespace understory
