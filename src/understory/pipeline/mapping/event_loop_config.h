#pragma once

#include "understory/preprocess/streams/event_orderer.h"

namespace understory {

// What the event loop can be set to, whatever the front end; described in the front ends' tables.
struct EventLoopConfig {
  EventOrderer::Config time_repair;
  double checkpoint_interval_s = 4.0;  // of recording
  int realtime_queue_scans = 3;        // --realtime: scans that may wait; older ones are dropped
};

}  // namespace understory
