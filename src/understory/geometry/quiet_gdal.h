#pragma once

#include <gdal_priv.h>

#include <cerrno>
#include <mutex>

namespace understory {

// While it lives GDAL is ready and keeps its messages off the terminal; the last one and errno tell
// what went wrong since. Include it in sources alone: the library is a heavy header.
class QuietGdal {
 public:
  QuietGdal() {
    static std::once_flag registered;
    std::call_once(registered, [] { GDALAllRegister(); });
    CPLPushErrorHandler(CPLQuietErrorHandler);
    CPLErrorReset();
    errno = 0;
  }
  ~QuietGdal() { CPLPopErrorHandler(); }
  QuietGdal(const QuietGdal&) = delete;
  QuietGdal& operator=(const QuietGdal&) = delete;
};

}  // namespace understory
