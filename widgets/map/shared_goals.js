// @ts-check
/**
 * The goals and routes of all pages, as the server tells of them.
 *
 * The server tells of a goal until its end, so a goal of another page that is missing has ended. The
 * outcome of a command without a ROS action can be unknown to the server, too: this page's own lost
 * route counts as ended only if the server has held it as lost. Of goals from before
 * its own restart, the server knows nothing: they are lost until somebody ends them.
 *
 * @typedef {import("./choose.js").Choice} Choice
 * @typedef {import("../../urc/web/static/core/types.js").Goal} Goal
 */
import { routeOf, tripOf } from "./goal_arguments.js";

/**
 * Take the goals from the server.
 *
 * @param {Choice} choice
 * @param {{isKnown: boolean, goals: readonly Goal[]}} news
 */
export function shareGoals(choice, news) {
  const { isKnown, goals } = news;
  const isNews = choice.news !== news;
  choice.news = news;
  if (isKnown) {
    const last = (/** @type {string} */ output) => {
      const own = goals.filter((one) => one.output === output);
      return own.filter(({ isLost }) => !isLost).at(-1) ?? own.at(-1); // a lost goal hides no running one
    };
    choice.trip = tripOf(last("goto"), choice.isLocal);
    shareRoute(choice, last("waypoints"));
  } else if (isNews) {
    if (choice.trip) choice.trip.isLost = true;
    const { active } = choice;
    if (active) active.goal = 0; // numbers begin anew
    if (active?.number === 0) active.isLost = true;
  }
  choice.edited();
}

/**
 * @param {Choice} choice
 * @param {Goal | undefined} goal
 */
function shareRoute(choice, goal) {
  const { active } = choice;
  if (active?.goal && active.goal !== goal?.number) {
    if (active.number === 0 && active.end === "") choice.active = null; // ended elsewhere
    else if (active.number === 0 || (active.isLost && active.isHeld)) choice.leftOver(active);
  }
  if (!goal) return;
  const now = choice.active;
  if (goal.isOurs && choice.sent > 0) {
    if (now && now.number > 0) {
      now.goal = goal.number; // the reply tells of its end
      now.isHeld = goal.isLost;
    }
  } else if (now === null || (now.number === 0 && [0, goal.number].includes(now.goal))) {
    adopt(choice, goal);
  }
}

/**
 * Show a route of another page.
 *
 * @param {Choice} choice
 * @param {Goal} goal
 */
function adopt(choice, goal) {
  const { number, by, isLost, since } = goal;
  const { active, feedback } = choice;
  if (active && active.goal === number) {
    active.isLost = isLost;
    return;
  }
  const route = routeOf(goal, choice.isLocal);
  if (!route) return;
  const { told } = feedback;
  const serial = told && told.time < since ? told.serial : -1; // of an earlier route
  choice.active = { route, number: 0, goal: number, by, at: 0, serial, end: "", isEnding: false, isLost, isHeld: isLost, before: null };
  if (told) choice.advance(told);
}
