/* Traffic lights for a crossing as a table of states; RA4 is the button for pedestrians. */
#pragma config FOSC = XT, WDTE = OFF, PWRTE = ON, CP = OFF
#include <xc.h>
#define _XTAL_FREQ 4000000

#include <stdint.h>

enum state { GREEN, AMBER, RED, RED_AMBER };

typedef struct {
    uint8_t lights;                        /* RB0 red, RB1 amber, RB2 green; RB3 stop, RB4 walk */
    uint8_t tenths;
    enum state next;
} step_t;

const step_t steps[4] = {
    {0b01100, 40, AMBER},
    {0b01010, 10, RED},
    {0b10001, 30, RED_AMBER},
    {0b01011, 5, GREEN},
};

void main(void)
{
    enum state now = GREEN;

    PORTB = 0;
    TRISB = 0;
    while (1) {
        PORTB = steps[now].lights;
        for (uint8_t n = steps[now].tenths; n; n--)
            __delay_ms(100);
        if (now == GREEN)
            while (PORTAbits.RA4)
                ;
        now = steps[now].next;
    }
}
