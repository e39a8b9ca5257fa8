#pragma once

#include "app/job.h"
#include "app/job_table.h"

namespace crosstie::app {

// The sections of a job.toml. Each takes the file's root and fills its part of the job; what is wrong is told to the table.

void read_cameras(const JobTable& root, Job& job);
void read_rig(const JobTable& root, Job& job);
void read_board(const JobTable& root, Job& job);
void read_network(const JobTable& root, Job& job);
void read_cross(const JobTable& root, Job& job);
void read_machine(const JobTable& root, Job& job);
void read_stations(const JobTable& root, Job& job);
void read_hole(const JobTable& root, Job& job);
void read_part(const JobTable& root, Job& job);
void read_path(const JobTable& root, Job& job);
void read_limits(const JobTable& root, Job& job);

}  // namespace crosstie::app
