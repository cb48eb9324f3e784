#pragma once
#include "pipeline/io/table.h"

namespace texmesh {
using TextTable = Table;
}
