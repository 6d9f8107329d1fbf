#include "understory/pipeline/mapping/map_documents.h"

#include "understory/pipeline/georeferencing/online_path.h"
#include "understory/pipeline/source.h"

namespace understory {

RunDocuments map_documents(const ReadRecording& recording, const StageTimes& times) {
  const MappingRequest& request = recording.request;
  const RunFacts& facts = recording.facts;
  RunDocuments documents("map", request.config_record, times, recording.log, facts.elapsed_s);
  documents.add_inputs(hash_inputs(request.recording, recording.log, recording.progress));
  documents.tell_world_in(world_frame_of(request.config));
  documents.report().title = std::filesystem::path(request.recording).filename().string();
  if (facts.online != nullptr) {
    const GeoreferenceConfig& config = georeference_of(request.config);
    documents.summary().quality.merge(facts.online->write(recording.results, config));
  }
  if (facts.memory_mb.size() > 1) {
    documents.summary().quality["memory_mb_half"] = facts.memory_mb[facts.memory_mb.size() / 2];
    documents.summary().quality["memory_mb_end"] = facts.memory_mb.back();
  }
  if (!facts.realtime) return documents;
  documents.count("scans_dropped", facts.dropped_scans);
  add_latency(distribution_of(facts.latencies_ms), documents.summary());
  return documents;
}

}  // namespace understory
