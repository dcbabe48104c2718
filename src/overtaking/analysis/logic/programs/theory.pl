% Conclusions from the facts of overtaking, for SWI-Prolog. `theory.lp` has the same rules for clingo.
%
% S is a simulation, A and B are vehicles (the ego has number 0), F is a frame. Positions and lengths
% are in mm, speeds in mm/s. The rules hold in the frames with positions (frame/2), among which are
% all in which a vehicle changes lane, or comes to be ahead of, beside or behind another one.
%
%     swipl facts.pl theory.pl -g "forall(overtakes(S,0,B,F), writeln(S/B/F))" -t halt

% in_lane(S,V,F,L): V is in lane L in frame F.
in_lane(S, V, F, L) :-
    position(S, V, F, _),
    lane(S, V, L, P, Q), P =< F, F =< Q.

% beside(S,A,B,F): A and B overlap along the road. No half is rounded away.
beside(S, A, B, F) :-
    apart(S, A, B, F, D, T),
    D < T, -D < T.

% clear_ahead(S,A,B,F): the whole of A is ahead of the whole of B.
clear_ahead(S, A, B, F) :-
    apart(S, A, B, F, D, T),
    D >= T.

% apart(S,A,B,F,D,T): twice the distance of two centres, and the sum of two lengths.
apart(S, A, B, F, D, T) :-
    position(S, A, F, X), position(S, B, F, Y), A =\= B,
    vehicle(S, A, _, M, _), vehicle(S, B, _, N, _),
    D is 2*(X-Y), T is M+N.

% opposite(S,A,B): A and B drive in opposite directions.
opposite(S, A, B) :-
    drives_against(S, A), vehicle(S, B, _, _, _), \+ drives_against(S, B).
opposite(S, A, B) :-
    drives_against(S, B), vehicle(S, A, _, _, _), \+ drives_against(S, A).

% oncoming(S,A,B,F): A drives towards B, which drives along the road.
oncoming(S, A, B, F) :-
    drives_against(S, A), opposite(S, A, B),
    position(S, A, F, X), position(S, B, F, Y), X > Y.

% ahead(S,A,B,F): A is ahead of B in the same lane and direction.
ahead(S, A, B, F) :-
    in_lane(S, A, F, L), in_lane(S, B, F, L), A =\= B, \+ opposite(S, A, B),
    position(S, A, F, X), position(S, B, F, Y), X > Y.

% behind(S,B,A,F): B is behind A in the same lane.
behind(S, B, A, F) :-
    ahead(S, A, B, F).

% between(S,A,B,F): a vehicle is between A and B ahead of it.
between(S, A, B, F) :-
    ahead(S, C, A, F), ahead(S, B, C, F).

% left_of(S,A,B,F): A is in a lane to the left of B's.
left_of(S, A, B, F) :-
    in_lane(S, A, F, K), in_lane(S, B, F, L), K > L.

% closing(S,A,B,F): A is behind B in the same lane, and faster.
closing(S, A, B, F) :-
    behind(S, A, B, F),
    speed(S, A, F, V), speed(S, B, F, W), V > W.

% As for the events: a vehicle follows up to this time gap.
following_time_gap_s(3).

% follows(S,A,B,F): B is next ahead of A, with a gap of less than 3 s.
follows(S, A, B, F) :-
    behind(S, A, B, F), \+ between(S, A, B, F),
    apart(S, B, A, F, D, T),
    speed(S, A, F, V), following_time_gap_s(G), D-T < 2*G*V.

% changes_lane(S,V,K,L,F): V changes from lane K to lane L.
changes_lane(S, V, K, L, F) :-
    lane(S, V, L, F, _), E is F-1,
    lane(S, V, K, _, E).

% leaves_behind(S,A,B,K,F): A leaves lane K to the left while B is ahead in it.
leaves_behind(S, A, B, K, F) :-
    changes_lane(S, A, K, L, F), L > K,
    in_lane(S, B, F, K),
    position(S, A, F, X), position(S, B, F, Y), X < Y.

% not_next_ahead(S,A,B,F): A leaves another vehicle behind that is nearer to it than B.
not_next_ahead(S, A, B, F) :-
    leaves_behind(S, A, B, K, F), leaves_behind(S, A, C, K, F), B =\= C,
    position(S, B, F, Y), position(S, C, F, Z), Z < Y.

% pulls_out(S,A,B,F): A changes to the left behind B, the next vehicle ahead.
pulls_out(S, A, B, F) :-
    leaves_behind(S, A, B, _, F), \+ not_next_ahead(S, A, B, F).

% passes(S,A,B,G): the whole of A is ahead of B, and was not before.
passes(S, A, B, G) :-
    next(S, F, G),
    clear_ahead(S, A, B, G),
    position(S, A, F, _), position(S, B, F, _),
    \+ clear_ahead(S, A, B, F).

% returns(S,A,B,F): A changes to the right into the lane of B, ahead of it.
returns(S, A, B, F) :-
    changes_lane(S, A, K, L, F), L < K,
    in_lane(S, B, F, L),
    position(S, A, F, X), position(S, B, F, Y), X > Y.

% came_back_before(S,A,F,H): before frame H, A was back in the lane that it left in frame F.
came_back_before(S, A, F, H) :-
    changes_lane(S, A, K, _, F), changes_lane(S, A, _, K, G),
    changes_lane(S, A, _, K, H), F < G, G < H.

% overtakes(S,A,B,H): A is back in its lane, having left it behind B and passed B on the left.
overtakes(S, A, B, H) :-
    leaves_behind(S, A, B, K, F),
    changes_lane(S, A, L, K, H), L > K, F < H, \+ came_back_before(S, A, F, H),
    passes(S, A, B, G), F < G, G =< H,
    left_of(S, A, B, G).

% collides(S,A,B,F): A and B have touched.
collides(S, A, B, F) :-
    contact(S, A, B, F).
collides(S, A, B, F) :-
    contact(S, B, A, F), \+ contact(S, A, B, F).
