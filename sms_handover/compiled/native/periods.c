/* Quiet reference periods: what simulation/loop.py does in each while nothing has to be decided.
 *
 * The targets stand still: led arms go to a pose in world, the others to joint angles.
 */

/* All fields have 8 bytes; compiled/periods.py has the same order. */
typedef struct {
  double targets[ARMS * POSE_ROW];      /* in world, of the arms that are led */
  double joints[N], rates[N];           /* rad of the other arms, rad/s of all */
  double in_tool[POSE];                 /* the deputy in the tool that holds it */
  double deputy[POSE_ROW];              /* its row: in world where nobody holds it, at the last period */
  double deputy_twist[TWIST];           /* at the last period, where it is held */
  long long led[ARMS], holder;          /* -1: nobody */
  long long failures, most_failures;    /* of inverse kinematics in a row; 0: any number */
} quiet_t;

typedef struct {
  double reference[N], targets[ARMS * POSE_ROW], tools[ARMS * POSE_ROW], deputy[POSE_ROW];
  double conserved[10], work, status;   /* as in compiled/kinematics_functions.py; J; -1: not asked */
} period_t;

/* Carry out at most `count` periods of `ticks` ticks each; return how many, fewer after a last failure. */
long sms_periods(ticks_t *t, long scheme, const ik_settings_t *settings, quiet_t *quiet, period_t *periods,
                 double *rows, long count, long ticks, double *w) {
  int any = 0, all = 1;
  for (int arm = 0; arm < ARMS; arm++)
    if (quiet->led[arm]) any = 1;
    else all = 0;
  for (long k = 0; k < count; k++, rows += ticks * (NQ + NV + 2 * N)) {
    period_t *p = periods + k;
    double twists[ARMS * TWIST], q[NQ];
    if (quiet->holder >= 0)
      sms_motion_rows(t->q, t->v, quiet->holder, quiet->in_tool, p->tools, twists, quiet->deputy,
                      quiet->deputy_twist, w);
    else
      sms_tool_rows(t->q, p->tools, w);
    memcpy(p->deputy, quiet->deputy, sizeof p->deputy);
    const double *arguments[ARGUMENTS] = {t->q, t->v, t->true_parameters};
    double *results[ARGUMENTS] = {p->conserved};
    sms_conserved(arguments, results, 0, w, 0);
    p->work = t->work;
    memcpy(p->reference, quiet->joints, sizeof p->reference);
    p->status = -1.0;
    if (any) {
      ik_solution_t solution;
      memcpy(solution.joints, quiet->joints, sizeof solution.joints);
      for (int arm = 0; arm < ARMS; arm++)
        if (quiet->led[arm])
          memcpy(solution.joints + first_joint[arm], t->q + 7 + first_joint[arm],
                 arm_joints[arm] * sizeof *solution.joints);
      sms_find_joints(t->q, quiet->targets, quiet->led, settings, &solution, w);
      memcpy(p->reference, solution.joints, sizeof p->reference);
      p->status = (double)solution.status;
      quiet->failures = solution.status == CONVERGED ? 0 : quiet->failures + 1;
    }
    if (!all) {
      memcpy(q, t->q, 7 * sizeof *q), memcpy(q + 7, p->reference, sizeof p->reference);
      sms_tool_rows(q, p->targets, w);
    }
    for (int arm = 0; arm < ARMS; arm++)
      if (quiet->led[arm])
        memcpy(p->targets + POSE_ROW * arm, quiet->targets + POSE_ROW * arm, POSE_ROW * sizeof *p->targets);
    memcpy(t->motion[0], p->reference, sizeof p->reference);
    memcpy(t->motion[1], quiet->rates, sizeof quiet->rates);
    for (int j = 0; j < N; j++) t->motion[2][j] = 0.0;
    t->reference_ns = t->stamp_ns;
    sms_ticks(t, scheme, rows, ticks, ticks, w);
    if (quiet->most_failures > 0 && quiet->failures >= quiet->most_failures) return k + 1;
  }
  return count;
}
