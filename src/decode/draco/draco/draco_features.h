/* What the decoder holds: meshes of bitstream 2.2, glTF's. Draco's own build writes a header of
 * this name. */
#pragma once

#define DRACO_MESH_COMPRESSION_SUPPORTED
#define DRACO_NORMAL_ENCODING_SUPPORTED
#define DRACO_PREDICTIVE_EDGEBREAKER_SUPPORTED
#define DRACO_STANDARD_EDGEBREAKER_SUPPORTED
