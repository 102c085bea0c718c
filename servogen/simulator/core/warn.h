/* Records noteworthy actions of the program, each once, with its cycle. */

#ifndef WARN_H
#define WARN_H

#include "state.h"

/* Records `code` about `subject` (a pin, an address) for an instruction at `place`, unless it is already
   recorded or there are many of its kind. */
RARE void warn_of(Chip *s, i64 code, i64 subject, i64 cycle, i64 place)
{
    i64 key = code << 16 | subject;
    i64 count = s->warn_count;
    for (i64 i = 0; i < count; i++)
        if (s->warnings[WARNING_FIELDS * i] == key)
            return;
    i64 room = code < WARN_UNDEFINED    ? WARNING_SLOTS
               : code == WARN_UNDEFINED ? WORD_WARNINGS
                                        : HARMLESS_WARNINGS;
    if (count < room) {
        s->warnings[WARNING_FIELDS * count] = key;
        s->warnings[WARNING_FIELDS * count + 1] = cycle;
        s->warnings[WARNING_FIELDS * count + 2] = place;
        s->warn_count = count + 1;
    }
}

/* Records `code` about `subject` for the instruction that is executed. */
RARE void warn(Chip *s, i64 code, i64 subject)
{
    warn_of(s, code, subject, s->cycle, s->here);
}

#endif
