/* In the place of Imath's: without it the library converts halves by code of its own. */
#pragma once
