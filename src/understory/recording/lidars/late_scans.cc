#include "understory/recording/lidars/late_scans.h"

#include <utility>

#include "understory/recording/messages/arrival_times.h"

namespace understory {
namespace {

class LateScans : public Recording, public ArrivalTimes {
 public:
  LateScans(std::unique_ptr<Recording> recording, TimeNs late)
      : recording_(std::move(recording)),
        arrivals_(dynamic_cast<const ArrivalTimes*>(recording_.get())),
        late_(late) {}

  std::optional<Event> next() override {
    std::optional<Event> event = recording_->next();
    if (!event) return event;
    if (auto* scan = std::get_if<ScanPtr>(&*event)) {
      auto moved = std::make_shared<Scan>(**scan);
      moved->stamp -= late_;
      *scan = std::move(moved);
    }
    return event;
  }
  void skip(std::uint64_t count) override { recording_->skip(count); }
  bool save(BinaryWriter& writer) const override { return recording_->save(writer); }
  void load(BinaryReader& reader) override { recording_->load(reader); }
  const Rig& rig() const override { return recording_->rig(); }
  std::vector<TopicReport> topics() const override { return recording_->topics(); }
  std::string format() const override { return recording_->format(); }
  double progress() const override { return recording_->progress(); }
  std::optional<TimeNs> arrival() const override {
    return arrivals_ == nullptr ? std::nullopt : arrivals_->arrival();
  }

 private:
  std::unique_ptr<Recording> recording_;
  const ArrivalTimes* arrivals_;  // null where the recording does not tell them
  TimeNs late_;
};

}  // namespace

std::unique_ptr<Recording> without_lateness(std::unique_ptr<Recording> recording, double late_s) {
  if (late_s == 0.0) return recording;
  return std::make_unique<LateScans>(std::move(recording), from_seconds(late_s));
}

}  // namespace understory
