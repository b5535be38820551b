/* The simulator's C interface: one world of board, plant, sensor, arm and
 * environment, in virtual time (integer microseconds since power-on).
 *
 * Lengths in mm, angles in rad, forces in N. The world's z axis points up. Frame
 * D of the robot hangs from the arm with its z axis pointing down:
 * x_D = x_world, y_D = -y_world, z_D = -z_world.
 *
 * No call keeps a pointer beyond its return. Every call that can fail returns
 * 0 on success and a negative code otherwise; setae_world_error says more. */
#pragma once

#include <stddef.h>
#include <stdint.h>

#ifdef __cplusplus
extern "C" {
#endif

#define SETAE_BACKBONE_POINTS 21
#define SETAE_TENDONS 4

typedef struct setae_world setae_world;

typedef struct {
  int64_t time_us;
  double arm_mm[3]; /* origin of frame D in the world */
  double arm_target_mm[3];
  int32_t arm_moving;
  int32_t board_attached;                /* bit i: servo i has pulses */
  double pulse_us[SETAE_TENDONS];        /* what the board puts out; 0 where detached */
  double servo_length_mm[SETAE_TENDONS]; /* free tendon length that the servo leaves, true */
  double tension_n[SETAE_TENDONS];
  double backbone_mm[SETAE_BACKBONE_POINTS][3]; /* frame D, from D to U */
  double rotation[9];                           /* D to U, row major */
  double filament_mm[2][3];                     /* frame D: root and undeformed tip E */
  double contact_depth_mm;                      /* deepest penetration of the undeformed filament */
  double contact_point_mm[3]; /* where, in the world; valid if contact_depth_mm > 0 */
  double bent_tip_mm[3];      /* the filament's tip at the sensor's last sample, in the world */
  double pressure_hpa;        /* true pressure at the sensor, noise included */
  /* Scaled gradient norm of this equilibrium; below 1e-4 it is solved. NaN: of another plant. */
  double plant_residual;
  double largest_residual;  /* of all samples since the start; NaN: of another plant */
  int64_t unsolved_samples; /* how many of them have no solution; -1: of another plant */
  int64_t plant_iterations; /* Newton's steps to this equilibrium; -1: of another plant */
} setae_truth;

/* A world with every parameter at its default; nothing runs yet. */
setae_world* setae_world_create(uint64_t seed);
void setae_world_destroy(setae_world*);
const char* setae_world_error(const setae_world*);

/* Named parameters, e.g. "spring.axial_rate_n_per_mm"; before the start only. */
int setae_world_parameter_count(void);
const char* setae_world_parameter_name(int index);
int setae_world_parameter_range(int index, double* least, double* most);
int setae_world_set(setae_world*, const char* name, double value);
int setae_world_get(const setae_world*, const char* name, double* value);

/* Another plant in the place of the built-in spring; before the start only. It is
 * asked at the start and at each of the sensor's samples, with time never going
 * back, and its answer holds until the next. It returns 0, or anything else to end
 * the run. `user` is handed through. Bristle, sensor, arm and solids stay the
 * world's own. */
typedef struct {
  int64_t time_us;
  int32_t attached;               /* bit i: servo i has pulses */
  double pulse_us[SETAE_TENDONS]; /* what the board puts out; 0 where detached */
  double pull_mm[SETAE_TENDONS];  /* what the world's own servos have wound up by now */
} setae_plant_input;

typedef struct {
  double position_mm[3]; /* of the spring's top U in frame D */
  double rotation[9];    /* D to U, row major */
  double tension_n[SETAE_TENDONS];
  double pressure_hpa; /* against rest, drift and noise included; NaN: the world's own bristle */
} setae_plant_output;

typedef int (*setae_plant_step)(void* user, const setae_plant_input*, setae_plant_output*);
int setae_world_use_plant(setae_world*, setae_plant_step step, void* user);

/* Solids that the bristle can touch, in the world; before the start only. */
int setae_world_add_tube(setae_world*, const double axis_point_mm[3], double inner_radius_mm);
/* Box: centre, edge lengths, turned by yaw about the world's z axis. */
int setae_world_add_box(setae_world*, const double centre_mm[3], const double edges_mm[3],
                        double yaw_rad);

/* Upright prism with rounded upright edges; wall_mm > 0: open at the top and hollow. */
int setae_world_add_prism(setae_world*, const double centre_mm[3], const double edges_mm[3],
                          double corner_mm, double wall_mm, double yaw_rad);
/* Lying ring of round section. */
int setae_world_add_ring(setae_world*, const double centre_mm[3], double ring_radius_mm,
                         double section_radius_mm);
int setae_world_add_ellipsoid(setae_world*, const double centre_mm[3], const double semi_axes_mm[3],
                              double yaw_rad);
/* Height of the topmost solid at x, y between two heights; -infinity where there is none. */
int setae_world_surface(setae_world*, double x_mm, double y_mm, double bottom_mm, double top_mm,
                        double* z_mm);

int setae_world_start(setae_world*, const double arm_mm[3]);

int64_t setae_world_now_us(const setae_world*);

/* Bytes from the host, put on the line at the current time. */
int setae_world_send(setae_world*, const uint8_t* data, size_t size);

/* Step until bytes for the host are there or the time has come, whichever is
 * first. `size`: in the room in `data`, out the bytes written. */
int setae_world_run(setae_world*, int64_t until_us, uint8_t* data, size_t* size);

/* Linear move of the arm with a trapezoidal speed profile; starts now. */
int setae_world_arm_move(setae_world*, const double target_mm[3], double speed_mm_s,
                         double acceleration_mm_s2);
/* Something outside the world moves the arm and is there now; the arm comes after it smoothly. */
int setae_world_arm_follow(setae_world*, const double position_mm[3]);
int setae_world_arm_stop(setae_world*, double acceleration_mm_s2);

int setae_world_truth(const setae_world*, setae_truth* out);

/* Faults to inject, for tests: 0 none, 1 absent, 2 silent, 3 bus error, 4 another chip,
 * 5 stuck, 6 out of range, 7 noisy. */
int setae_world_sensor_fault(setae_world*, int fault);
/* The board's supply, 5000 until then, and its stop switch, 1 (open) until then. */
int setae_world_supply(setae_world*, int supply_mv);
int setae_world_stop_switch(setae_world*, int open);
/* The reset button, or DTR: the board starts anew, retained memory and EEPROM survive. */
int setae_world_reset_board(setae_world*);

/* A board outside of this world, in step with it: the one inside goes. Its pulses come as they
 * end (a width of 0: there are no pulses any more), and the plant moves when its sensor takes a
 * sample. Bytes don't pass here any more. */
int setae_world_remove_board(setae_world*);
int setae_world_pulse(setae_world*, int servo, double width_us);
int setae_world_sense(setae_world*, double* pressure_hpa);

/* The spring alone, between 3 to 8 tendons in true holes: the plant of a world before its
 * start, without servos, friction and time. `angle_rad`: of each tendon about the axis. Null:
 * setae_world_error(world) says why. */
#define SETAE_TENDONS_MOST 8
typedef struct setae_spring setae_spring;
setae_spring* setae_world_spring(setae_world*, int tendons, const double* angle_rad);
void setae_spring_destroy(setae_spring*);

typedef struct {
  double position_mm[3]; /* of the top U in frame D */
  double rotation[9];    /* D to U, row major */
  double tension_n[SETAE_TENDONS_MOST];
  double energy_n_mm;
  double residual; /* scaled gradient norm; below 1e-4 it is solved */
  int32_t stable;  /* the energy rises in every direction from here */
} setae_rest;

/* Where it comes to rest with these free tendon lengths when let go from: bent by so much about
 * x and y, its top moved along x and y. */
int setae_spring_rest(setae_spring*, const double* length_mm, const double bend_rad[2],
                      const double shift_mm[2], setae_rest* out);

#ifdef __cplusplus
}
#endif
