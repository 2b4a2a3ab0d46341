#include "deploy/launch/commit.h"

#include "build_commit.h"  // made by cmake/Commit.cmake

namespace dbr {

const char* BuildCommit() {
  return DBR_BUILD_COMMIT;
}

}  // namespace dbr
