#pragma once

#include <filesystem>
#include <functional>
#include <string>
#include <vector>

#include "understory/pipeline/mapping/adaptation.h"
#include "understory/pipeline/mapping/front_end_config.h"
#include "understory/pipeline/mapping/positioned_scan.h"
#include "understory/pipeline/mapping/sensor_traits.h"
#include "understory/pipeline/run_folder/input_identity.h"
#include "understory/recording/recording.h"
#include "understory/util/config/config_origins.h"

namespace understory {

// What one call of `understory map` asks for.
struct MappingRequest {
  std::string recording;  // file, folder or sim:SITE
  std::filesystem::path run_folder;
  FrontEndConfig config;  // says which front end; the run adapts it to the sensors
  // As asked for, for run.json and for resuming, and what the run made of it, for run.json.
  ConfigRecord config_record;
  OpenOptions open;
  bool realtime = false;   // played at the speed of its sensors; late scans are dropped
  bool overwrite = false;  // start anew although the folder holds an unfinished run
  // What the run found out itself, and goes on from when it is resumed.
  SensorTraits traits;
  RunConditions conditions;
  // Told of each scan that has got its pose, in order of time. A recording that is begun anew is
  // told from its beginning. Empty: nobody listens.
  std::function<void(const PositionedScan&)> on_positioned;
  // Of a resumed run: where it was begun, if that is not the current folder; else empty.
  std::filesystem::path begun_in;

  // A file as the run's start named it: as given, or by its absolute path where the run is resumed
  // from another folder.
  [[nodiscard]] std::string found(const std::string& file) const;
  // The recording and everything else that is read, in a fixed order. Throws InputError.
  [[nodiscard]] std::vector<InputIdentity> identify_inputs() const;
};

}  // namespace understory
